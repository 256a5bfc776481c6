"""The rows of the benchmark: what is measured, how good it must be, and against whom."""

from ctcbs_ros.bench import cable_rows, flight_rows, periodic_rows, solver_rows
from ctcbs_ros.bench.row import Row

_US, _MS, _MB = 1e-6, 1e-3, 1e6
_BVP = "scipy solve_bvp, 1e-6, warm start"

ROWS = (
    Row(
        "steady-3.1", "corrected steady state from the table's guess, to 1e-8: Fig. 3.1, d_n 10",
        60 * _US, _BVP, solver_rows.steady_figure, needed=1 / 60,
    ),
    Row(
        "steady-design", "the same: design example", 150 * _US, _BVP, solver_rows.steady_design,
        needed=1 / 60,
    ),
    Row(
        "all-states", "all steady states of a random point of Table 2.1, none missed", 3 * _MS,
        "scipy solve_ivp scan + brentq", solver_rows.all_states,
    ),
    Row(
        "margin", "steady state + margin converged to 1 %: design example", 1.5 * _MS,
        "numpy eigvals, same matrices", solver_rows.margin,
    ),
    Row(
        "branch", "branch of Fig. 3.1, d_n 4.8: 80 points or more to 1e-8, both folds", 20 * _MS,
        "AUTO-07p, 80 points, NTST 20", solver_rows.branch, needed=0.4,
    ),
    Row(
        "cusp", "one cusp, found from nothing", 0.2, "scipy root, started 1 % away",
        solver_rows.one_cusp,
    ),
    Row(
        "settle", "the elastic steady state that MoorDyn settles to", None,
        "MoorDyn, 20 segments, to 1 %", solver_rows.settle,
    ),
    Row(
        "cable-600", "the cable in time, 40 segments, gamma 600: 8 orbits from rest", None,
        "MoorDyn, RK4, steps of 0.01 s", cable_rows.soft, needed=0.5,
    ),
    Row(
        "cable-design", "the same with the design example's parameters: 4 orbits", None,
        "MoorDyn, RK4, steps of 0.01 s", cable_rows.design, needed=0.5,
    ),
    Row(
        "cable-60000", "the first of these with gamma 60,000: 4 orbits", None,
        "MoorDyn, RK4, steps of 0.001 s", cable_rows.stiff, needed=0.1,
    ),
    Row(
        "periodic", "motion in a wind of a tenth of the tow speed, to 1e-3 a, from one nearby",
        50 * _MS, "cable in time from there, to settle", periodic_rows.soft,
    ),
    Row(
        "periodic-design", "the same: design example", 50 * _MS,
        "cable in time from there, to settle", periodic_rows.design,
    ),
    Row(
        "table-build", "table of the default envelope, every core", 10.0,
        "solve_bvp + eigvals, no folds, 12 nodes", flight_rows.table_build, long=True,
    ),
    Row(
        "table-size", "its file", 20 * _MB, "the same arrays", flight_rows.table_size, unit="B",
    ),
    Row("table-load", "its loading", 50 * _MS, "numpy load, unchecked", flight_rows.table_load),
    Row(
        "update", "update of the predictor, sample in, prediction out, no twin", 3 * _MS,
        "solve_bvp + eigvals alone", flight_rows.update, judged="p99",
    ),
    Row(
        "update-twin", "the same with the twin, as by default", 3 * _MS,
        "solve_bvp + eigvals alone", flight_rows.update_with_twin, judged="p99",
    ),
    Row(
        "replay", "a sample through replay --through core --rate 0, no twin", 1 * _MS,
        "pymavlink reading the log", flight_rows.replay,
    ),
    Row(
        "replay-twin", "the same with the twin, as by default", 1 * _MS,
        "pymavlink reading the log", flight_rows.replay_with_twin,
    ),
    Row(
        "node-start", "start of the node with a table, until ready", 3.0, "empty rclpy node",
        flight_rows.node_start, long=True,
    ),
    Row(
        "node-memory", "resident memory of the node when ready", 300 * _MB, "empty rclpy node",
        flight_rows.node_memory, unit="B", long=True,
    ),
)  # fmt: skip
