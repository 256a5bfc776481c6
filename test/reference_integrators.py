"""Two other ways to integrate the cable's nodes in time, with fixed steps: what was not chosen.

The classical Runge-Kutta method, whose step the axial waves limit to 2.785 over their highest
frequency, 2 sqrt(EA/mass per length)/segment; and the generalised-alpha method (Chung and Hulbert,
J. Appl. Mech. 60, 1993), implicit and of second order. `python test/reference_integrators.py`
prints what each costs and errs beside the product's.
"""

import numpy as np
from numba import njit

from ctcbs_ros.kernels.block_tridiagonal import factorise, solve
from ctcbs_ros.kernels.cable_forces import derivatives, forces, masses
from ctcbs_ros.kernels.cable_motion import accelerations, drive_at

_FUSED = {"contract"}
LIMIT = 2.785


@njit(cache=True, fastmath=_FUSED)
def runge_kutta(drive, line, t, step, count, x, v):
    """Take `count` steps from the state x, v, (n + 1, 3) each, which is replaced."""
    n = x.shape[0] - 1
    slope_x, slope_v = np.empty((4, n, 3)), np.empty((4, n, 3))
    y_x, y_v = x.copy(), v.copy()
    for _ in range(count):
        accelerations(drive, line, t, t, x, v, slope_v[0])
        slope_x[0] = v[:n]
        for s in range(1, 4):
            part = 0.5 * step if s < 3 else step
            for i in range(n):
                for a in range(3):
                    y_x[i, a] = x[i, a] + part * slope_x[s - 1, i, a]
                    y_v[i, a] = v[i, a] + part * slope_v[s - 1, i, a]
                    slope_x[s, i, a] = y_v[i, a]
            accelerations(drive, line, t + part, t + part, y_x, y_v, slope_v[s])
        for q, k in ((x, slope_x), (v, slope_v)):
            for i in range(n):
                for a in range(3):
                    q[i, a] += (
                        step / 6.0 * (k[0, i, a] + 2.0 * (k[1, i, a] + k[2, i, a]) + k[3, i, a])
                    )
        t += step
    accelerations(drive, line, t, t, x, v, slope_v[0])  # the tow point, where it is now


@njit(cache=True, fastmath=_FUSED)
def generalised_alpha(drive, line, t, step, count, x, v, rho, tolerance):
    """Take `count` steps with spectral radius rho at infinity; return Newton's iterations."""
    n = x.shape[0] - 1
    alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    gamma = 0.5 + alpha_f - alpha_m
    beta = 0.25 * (gamma + 0.5) ** 2
    old, y_x, y_v = np.empty((n, 3)), x.copy(), v.copy()
    force, before, residual = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    mass, wind, end, scratch = np.empty(n), np.empty(3), np.empty(3), np.empty(3)
    by_x, by_v = np.empty((3, n, 3, 3)), np.empty((3, n, 3, 3))
    accelerations(drive, line, t, t, x, v, old)
    length, rate, second = drive_at(drive, t, t, x, v, wind, end, scratch)
    forces(x, v, line, end, wind, length, rate, second, before)
    masses(line, end, length, n, mass)
    iterations = 0
    for _ in range(count):
        t += step
        length, rate, second = drive_at(drive, t, t, y_x, y_v, wind, end, scratch)
        new = old.copy()
        for _ in range(10):
            for i in range(n):
                for a in range(3):
                    y_x[i, a] = x[i, a] + step * (
                        v[i, a] + step * ((0.5 - beta) * old[i, a] + beta * new[i, a])
                    )
                    y_v[i, a] = v[i, a] + step * ((1.0 - gamma) * old[i, a] + gamma * new[i, a])
            forces(y_x, y_v, line, end, wind, length, rate, second, force)
            derivatives(y_x, y_v, line, end, wind, length, rate, second, by_x, by_v)
            matrix = -(1.0 - alpha_f) * (by_v * (gamma * step) + by_x * (beta * step * step))
            for i in range(n):
                for a in range(3):
                    matrix[1, i, a, a] += mass[i] * (1.0 - alpha_m)
                    inertia = (1.0 - alpha_m) * new[i, a] + alpha_m * old[i, a]
                    pull = (1.0 - alpha_f) * force[i, a] + alpha_f * before[i, a]
                    residual[i, a] = pull - mass[i] * inertia
            factorise(matrix[0], matrix[1], matrix[2])
            solve(matrix[0], matrix[1], matrix[2], residual)
            new += residual
            iterations += 1
            if np.abs(residual).max() * step * step < tolerance:
                break
        for i in range(n):
            for a in range(3):
                y_x[i, a] = x[i, a] + step * (
                    v[i, a] + step * ((0.5 - beta) * old[i, a] + beta * new[i, a])
                )
                y_v[i, a] = v[i, a] + step * ((1.0 - gamma) * old[i, a] + gamma * new[i, a])
        forces(y_x, y_v, line, end, wind, length, rate, second, before)
        x[:], v[:], old[:] = y_x, y_v, new
    return iterations


def longest_step(line, segments):
    """Longest step with which the Runge-Kutta method stays finite."""
    wave = np.sqrt(line.stiffness / line.mass_per_length)
    return LIMIT * line.length / segments / (2.0 * wave)


def compare() -> None:
    """Print cost and error of all three over two orbits in a wind that rises."""
    from time import process_time

    from points import STRETCHED, design, parameters

    from ctcbs_ros.dynamics.cable import drive, simulate
    from ctcbs_ros.dynamics.equilibrium import equilibrium
    from ctcbs_ros.dynamics.line import line_of
    from ctcbs_ros.dynamics.signal import circle, linear
    from ctcbs_ros.solver.steady_state import steady_states

    n, span = 40, 4.0 * np.pi

    def told(name, began, found):
        spent = 500.0 * (process_time() - began)
        off = np.abs(found - exact)
        print(f"{name:44} {spent:7.2f} ms an orbit, end mass {off[0].max():.1e}, "
              f"all {off.max():.1e}")  # fmt: skip

    for point in (STRETCHED, {**STRETCHED, "gamma": 6e4}, design(250.0)):
        (state,) = steady_states(parameters(point)).states
        line, start = line_of(state.parameters), equilibrium(state, n)
        driven = drive(
            line, circle(1.0, 1.0, 0.0, span),
            linear([0.0, 10.0], [[0.0, 0.0, 0.0], [0.1, 0.01, 0.0]]),
        )  # fmt: skip
        exact = simulate(line, driven, start, [span], 1e-8).positions[0]
        print(f"gamma {point['gamma']:.0f}, omega {point['omega']:.3g}, d_n {point['d_n']:.4g}")
        for tolerance in (1e-2, 1e-3, 1e-4, 1e-5):
            began = process_time()
            motion = simulate(line, driven, start, [span], tolerance)
            name = f"  Rosenbrock {tolerance:g}: {motion.steps / 2:.0f} steps"
            told(name, began, motion.positions[0])
        others = (driven.compiled, line.packed(), 0.0)
        for share in (1.05, 0.9, 0.5):
            count = int(span / longest_step(line, n) / share)
            x, v = start.positions.copy(), start.velocities.copy()
            runge_kutta(*others, span / count, 1, x.copy(), v.copy())
            began = process_time()
            runge_kutta(*others, span / count, count, x, v)
            told(f"  Runge-Kutta {share:g} of its limit: {count / 2:.0f} steps", began, x)
        for count in (100, 200, 400, 800):
            x, v = start.positions.copy(), start.velocities.copy()
            generalised_alpha(*others, span / count, 1, x.copy(), v.copy(), 0.8, 1e-7)
            began = process_time()
            generalised_alpha(*others, span / count, count, x, v, 0.8, 1e-7)
            told(f"  generalised alpha: {count / 2:.0f} steps", began, x)


if __name__ == "__main__":
    compare()
