"""All steady states of a parameter point, and the correction of one from a guess."""

from dataclasses import dataclass
from math import atan2, exp, hypot, log, pi

import numpy as np

from ctcbs_ros.errors import InputError
from ctcbs_ros.kernels import correction, search
from ctcbs_ros.kernels.correction import RESIDUAL_LIMIT
from ctcbs_ros.kernels.trajectory import N_THETA, OK, integrate
from ctcbs_ros.solver.parameters import Parameters

# Local error of an integration step. Scanning only counts roots; what is reported is integrated to
# an error far below the residual of 1e-9 that it must have.
SCAN_TOLERANCE = 1e-6
TOLERANCE = 1e-11
_NO_DIRECTIONS = np.empty((0, N_THETA))
_MOST_ROOTS = 64


@dataclass(frozen=True)
class SteadyState:
    """A steady state in the rotating frame, non-dimensional.

    Attributes
    ----------
    parameters : Parameters
    end_mass_radius, depth : float
        Radius of the end mass's circle and its depth below the tow plane.
    phase_lag : float
        Tow-point angle minus end-mass angle in the sense of rotation, in [0, 2 pi).
    tension_end_mass, tension_tow_point : float
        At both ends.
    least_tension, greatest_tension : float
        Along the cable. The greatest may lie inside it: tension falls towards the tow point where
        the cable there runs outward faster than it climbs.
    residual : float
        |x^2 + y^2 - 1| at the tow point, integrated again with every step halved.
    slope : float
        d(x^2 + y^2)/d ln(end-mass radius) at the tow point; 0 at a fold, and of the opposite sign
        on the other side of it.
    converged : bool
        Whether the residual is below 1e-9.
    """

    parameters: Parameters
    end_mass_radius: float
    depth: float
    phase_lag: float
    tension_end_mass: float
    tension_tow_point: float
    least_tension: float
    greatest_tension: float
    residual: float
    slope: float
    converged: bool

    def cable(self, arc_lengths) -> tuple[np.ndarray, np.ndarray]:
        """Shape of the cable in the rotating frame, the end mass at azimuth 0 and height 0.

        Parameters
        ----------
        arc_lengths : (n,) array_like
            Unstretched arc lengths from the end mass, in [0, length].

        Returns
        -------
        positions : (n, 3) ndarray
        tensions : (n, 3) ndarray
            Tension times unit tangent.
        """
        arc_lengths = np.asarray(arc_lengths, float)
        states = cable_states(self.parameters, self.end_mass_radius, arc_lengths)
        return states[:, :3], states[:, 3:]


@dataclass(frozen=True)
class SteadyStates:
    """All steady states in rising end-mass radius, and why some or all may be missing."""

    states: tuple[SteadyState, ...]
    complete: bool
    reason: str


def cable_states(parameters, end_mass_radius, arc_lengths, tolerance=1e-10) -> np.ndarray:
    """Position and tension vector at rising arc lengths, (n, 6), integrated from the end mass."""
    if arc_lengths.size == 0:
        return np.empty((0, 6))
    if np.any(np.diff(arc_lengths) < 0.0) or arc_lengths[0] < 0.0:
        raise InputError("arc lengths: they must rise from 0 (end mass) to the cable's length")
    states = np.empty((arc_lengths.size, 1, 6))
    status, _, _ = integrate(
        parameters.theta(end_mass_radius), _NO_DIRECTIONS, arc_lengths, tolerance,
        search.MAX_STEPS, states, np.empty(search.MAX_STEPS + 1),
    )
    if status != OK:
        raise ArithmeticError(
            f"the cable could not be integrated at end-mass radius {end_mass_radius:g}"
        )
    return states[:, 0, :]


def steady_states(parameters: Parameters) -> SteadyStates:
    """Find all steady states of a parameter point, isolated ones included.

    Parameters
    ----------
    parameters : Parameters

    Returns
    -------
    SteadyStates
        Empty, with the reason, where there is none.

    Notes
    -----
    Roots of thesis (2.17) as a function of the end-mass radius, counted by adaptive Hermite
    interpolation (`ctcbs_ros.kernels.search`). Stretched states are sought up to a strain of 3.
    """
    roots = np.empty(_MOST_ROOTS)
    count, work, failures = search.all_roots(
        parameters.theta(), parameters.length, SCAN_TOLERANCE, TOLERANCE, roots
    )
    found = [describe(parameters, u) for u in roots[:count]]
    states = tuple(s for s in found if s is not None and s.converged and s.least_tension > 0.0)
    slack = sum(s is not None and s.least_tension <= 0.0 for s in found)
    lost = len(found) - len(states) - slack
    reasons = []
    given_up = work >= search.MOST_WORK or count + 1 >= _MOST_ROOTS
    if given_up:
        reasons.append(
            "the search was given up: so far from thesis Table 2.1 there are more states than "
            "mean anything, or a cable too slack to be followed"
        )
    if failures:
        reasons.append(f"the cable could not be integrated at {failures} trial radii")
    if slack:
        reasons.append(f"{slack} left out: the cable is slack")
    if lost:
        reasons.append(f"{lost} left out: the residual stays above {RESIDUAL_LIMIT:g}")
    if not found and not reasons:
        reasons.append(
            f"no end-mass radius brings the cable to the tow circle below a strain of "
            f"{search.MAX_STRAIN:g}"
        )
    return SteadyStates(states, not (failures or lost or given_up), "; ".join(reasons))


def correct_state(parameters: Parameters, guess: float, max_step: float = 0.3):
    """Correct a guess of the end-mass radius by Newton's method.

    Parameters
    ----------
    parameters : Parameters
    guess : float
        End-mass radius near the wanted state.
    max_step : float
        Largest step in ln(end-mass radius) that still counts as the same branch.

    Returns
    -------
    SteadyState or None
        None where Newton's method fails or goes further than `max_step`.
    """
    theta, out = parameters.theta(), np.empty(correction.N_OUT)
    good = correction.correct(theta, parameters.length, log(guess), max_step, out)
    state = _state(parameters, out) if good else None
    return state if state is not None and state.converged else None


def describe(parameters: Parameters, u: float) -> SteadyState | None:
    """Everything about the state at u = ln(end-mass radius); None if the integration fails."""
    theta, out = parameters.theta(), np.empty(correction.N_OUT)
    good = correction.describe(theta, parameters.length, u, out)
    return _state(parameters, out) if good else None


def _state(parameters: Parameters, out: np.ndarray) -> SteadyState:
    """What `ctcbs_ros.kernels.correction` has found."""
    u, miss, slope, least_tension, greatest_tension, x, y, z, f_x, f_y, f_z = out.tolist()
    radius, square = exp(u), parameters.omega**2
    tension_end_mass = hypot(
        square * parameters.end_mass * radius,
        square * parameters.end_mass_drag * radius**2,
        parameters.end_weight,
    )
    tension_tow_point = hypot(f_x, f_y, f_z)
    return SteadyState(
        parameters=parameters,
        end_mass_radius=radius,
        depth=z,
        phase_lag=_positive_angle(atan2(y, x)),
        tension_end_mass=tension_end_mass,
        tension_tow_point=tension_tow_point,
        least_tension=least_tension,
        # Where it is that of an end, to the last digit.
        greatest_tension=max(greatest_tension, tension_end_mass, tension_tow_point),
        residual=abs(miss),
        slope=slope,
        converged=abs(miss) < RESIDUAL_LIMIT,
    )


def _positive_angle(angle: float) -> float:
    """The angle in [0, 2 pi); the remainder of a tiny negative one rounds to 2 pi itself."""
    angle %= 2.0 * pi
    return angle if angle < 2.0 * pi else 0.0
