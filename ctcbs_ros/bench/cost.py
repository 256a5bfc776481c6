"""What accuracy costs: error and time against basis functions, tolerance, and table size."""

from dataclasses import dataclass
from math import log
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from ctcbs_ros.bench import peer_bvp, peer_ivp
from ctcbs_ros.bench.session import Session
from ctcbs_ros.bench.solver_rows import FIGURE_3_1
from ctcbs_ros.bench.timing import processor_time, timed
from ctcbs_ros.errors import InputError
from ctcbs_ros.files import atomic_file
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.solver.stability import eigenvalues, stability
from ctcbs_ros.solver.steady_state import TOLERANCE, cable_states, correct_state, steady_states
from ctcbs_ros.table.build import NODES, build_table

FUNCTIONS = (4, 6, 8, 10, 12, 15, 18, 22, 27, 33, 40, 50)
MOST_FUNCTIONS = 80
TOLERANCES = 10.0 ** np.arange(-3.0, -13.5, -1.0)
PEER_TOLERANCES = 10.0 ** np.arange(-2.0, -8.5, -1.0)
TABLE_NODES = (3, 5, 9, 17, NODES)
_GUESSES = 300
_REPEATS = 15
SUFFIXES = (".png", ".pdf", ".svg")


@dataclass(frozen=True)
class Curve:
    """Relative error and processor time [s] against a size, each (n,)."""

    label: str
    size: np.ndarray
    error: np.ndarray
    time: np.ndarray


def margin_cost(label: str, p) -> Curve:
    """Of the margin, against functions a coordinate; judged by the one with most."""
    state = steady_states(p).states[0]
    band = stability(state).band

    def growth(functions):
        values = eigenvalues(state, functions)
        return values[np.abs(values.imag) <= band].real.max()

    exact = growth(MOST_FUNCTIONS)
    error = [abs(growth(n) / exact - 1.0) for n in FUNCTIONS]
    spent = [_median_time(lambda n=n: eigenvalues(state, n)) for n in FUNCTIONS]
    return Curve(label, np.array(FUNCTIONS), np.array(error), np.array(spent))


def integration_cost(label: str, p) -> Curve:
    """Of the end-mass radius, against the tolerance of one integration of the cable.

    The error is what a miss of the tow circle at the exact radius does to the radius, h/h_u.
    """
    state = steady_states(p).states[0]
    exact = peer_ivp.tight_state(p, state.end_mass_radius)
    top = np.array([p.length])

    def end(tolerance):
        return cable_states(p, exact, top, tolerance)[0]

    miss = [end(t)[0] ** 2 + end(t)[1] ** 2 - 1.0 for t in TOLERANCES]
    spent = [_median_time(lambda t=t: end(t)) for t in TOLERANCES]
    return Curve(label, TOLERANCES, np.abs(np.array(miss) / state.slope), np.array(spent))


def bvp_cost(label: str, p) -> Curve:
    """Of the end-mass radius by solve_bvp, against its tolerance, from 0.1 % away."""
    exact = peer_ivp.tight_state(p, steady_states(p).states[0].end_mass_radius)
    guess = 1.001 * exact
    start = peer_bvp.warm_start(p, guess)
    error = [
        abs(peer_bvp.steady_state(p, guess, start, t) / exact - 1.0) for t in PEER_TOLERANCES
    ]
    spent = [
        _median_time(lambda t=t: peer_bvp.steady_state(p, guess, start, t), 3)
        for t in PEER_TOLERANCES
    ]
    return Curve(label, PEER_TOLERANCES, np.array(error), np.array(spent))


def table_costs(configuration) -> tuple[Curve, Curve]:
    """Median and worst error of the table's guesses against its nodes a side; time to build it."""
    rng = np.random.default_rng(1)
    ends = configuration.envelope.radius, configuration.envelope.speed
    at = [np.exp(rng.uniform(log(low), log(high), _GUESSES)) for low, high in ends]
    rows = []
    for nodes in tqdm(TABLE_NODES, desc="tables", unit="table"):
        before = processor_time()
        table = build_table(configuration, nodes, progress=False)
        spent = processor_time() - before
        points = [
            flight_point(configuration, radius, speed, table.density)
            for radius, speed in zip(*at, strict=True)
        ]
        errors = [error for point in points for error in _guess_errors(table, point)]
        rows.append((np.median(errors), max(errors), spent))
    middle, worst, spent = np.array(rows).T
    size = np.array(TABLE_NODES)
    return Curve("median guess", size, middle, spent), Curve("worst guess", size, worst, spent)


def _guess_errors(table, point) -> list[float]:
    errors = []
    for guess in table.guesses(point) or ():
        state = correct_state(point.parameters, guess)
        if state is not None:
            errors.append(abs(guess / state.end_mass_radius - 1.0))
    return errors


def _median_time(call, repeats=_REPEATS) -> float:
    call()
    return float(np.median([timed(lambda _: call()).cpu for _ in range(repeats)]))


@dataclass(frozen=True)
class Column:
    """Curves against one kind of size, the value of it that is used, and its ticks."""

    title: str
    size: str
    used: float
    curves: tuple[Curve, ...]
    ticks: tuple[int, ...] | None = None


def plot_costs(path: str) -> None:
    """Measure and draw all curves.

    Parameters
    ----------
    path : str
        Its suffix decides the format.

    Raises
    ------
    InputError
        If the suffix is not one of `SUFFIXES`, or the file cannot be written.
    """
    if Path(path).suffix not in SUFFIXES:
        raise InputError(f"{path}: must end in {', '.join(SUFFIXES)}")
    with atomic_file(path, "wb") as file, threadpool_limits(1), Session() as session:
        cases = (("Fig. 3.1, d_n 10", FIGURE_3_1), ("design example", session.design))
        with tqdm(total=3 * len(cases), desc="curves", unit="curve") as bar:

            def curves(function, prefix=""):
                for label, p in cases:
                    bar.update()
                    yield function(prefix + label, p)

            margins = tuple(curves(margin_cost))
            radii = (*curves(integration_cost), *curves(bvp_cost, "solve_bvp: "))
        columns = (
            Column(
                "margin", "Galerkin functions a coordinate",
                stability(steady_states(session.design).states[0]).functions, margins,
                (4, 8, 16, 32),
            ),
            Column("end-mass radius", "local tolerance", TOLERANCE, radii),
            Column(
                "guess from the table", "nodes a side", NODES, table_costs(session.drone),
                TABLE_NODES,
            ),
        )  # fmt: skip
        figure = _drawn(columns)
        figure.savefig(file, format=Path(path).suffix[1:], dpi=120)


def _drawn(columns):
    """The figure: errors above, times below, one column for each kind of size."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogFormatterMathtext, NullFormatter, ScalarFormatter

    figure = Figure(figsize=(12, 6.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, len(columns), sharex="col")
    for (above, below), column in zip(axes.T, columns, strict=True):
        for number, curve in enumerate(column.curves):
            style = dict(color=f"C{number % 2}", marker="o", markersize=3.5)
            if number >= 2:  # of the peer
                style |= dict(linestyle="--", marker="s", fillstyle="none")
            above.loglog(curve.size, np.maximum(curve.error, 1e-16), label=curve.label, **style)
            if number == 0 or not np.array_equal(curve.time, column.curves[0].time):
                below.loglog(curve.size, curve.time, **style)
        for panel in (above, below):
            panel.axvline(column.used, color="0.6", linewidth=1.0, label="in use", zorder=0)
            panel.grid(alpha=0.3)
            panel.yaxis.set_minor_formatter(NullFormatter())
            panel.yaxis.set_major_formatter(LogFormatterMathtext())
        above.set_title(f"error of the {column.title}")
        below.set_xlabel(column.size)
        if column.ticks:
            below.set_xticks(column.ticks)
            below.xaxis.set_major_formatter(ScalarFormatter())
            below.xaxis.set_minor_formatter(NullFormatter())
        else:
            below.invert_xaxis()  # finer to the right, as in the others
    axes[0, 0].set_ylabel("relative error")
    axes[1, 0].set_ylabel("processor time [s]")
    axes[1, 2].set_ylabel("processor time to build the table [s]")
    axes[1, 2].set_ylim(1.0, 100.0)
    # Where no curve is; the labels are those of the panels above.
    axes[0, 0].legend(loc="lower left", fontsize="small")
    axes[1, 1].legend(*axes[0, 1].get_legend_handles_labels(), loc=(0.35, 0.33), fontsize="small")
    axes[0, 2].legend(loc="lower left", fontsize="small")
    return figure
