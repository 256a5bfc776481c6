"""A fold kept exact while the flight changes, at the cost of about two integrations.

Newton's method for h = dh/du = 0 with the second derivatives of the fold as it was found: from one
sample to the next they hardly change, so its error still shrinks a hundredfold in each iteration.
"""

from dataclasses import dataclass
from math import exp, log

import numpy as np

from ctcbs_ros.kernels.continuation import correct_fold, level
from ctcbs_ros.kernels.search import MAX_STEPS
from ctcbs_ros.kernels.trajectory import OK
from ctcbs_ros.solver.branches import Fold
from ctcbs_ros.solver.family import ANGULAR_RATE, Family
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.solver.steady_state import TOLERANCE

# Steps in tau and u, after which what is left is far below 1e-8.
_CONVERGED = 1e-8, 1e-6
_ITERATIONS = 5
# Half the distance in u over which second derivatives are taken.
_DIFFERENCE = 1e-4


@dataclass(frozen=True)
class KnownFold:
    """A fold and the curvature of the level set there.

    Attributes
    ----------
    parameters : Parameters
        Flown, at tau = 0.
    family : Family
        ANGULAR_RATE or RADIUS_AT_SPEED.
    fold : Fold
    h_uu, h_utau : float
        Second derivatives of h (see `ctcbs_ros.kernels.continuation`).
    """

    parameters: Parameters
    family: Family
    fold: Fold
    h_uu: float
    h_utau: float


def known_fold(parameters: Parameters, family: Family, fold: Fold) -> KnownFold | None:
    """A fold found by a trace, with its second derivatives; None if they cannot be had."""
    u = log(fold.end_mass_radius)
    above = _level(parameters, family, fold.tau, u + _DIFFERENCE)
    below = _level(parameters, family, fold.tau, u - _DIFFERENCE)
    if above is None or below is None:
        return None
    h_uu, h_utau = (0.5 * (above[k] - below[k]) / _DIFFERENCE for k in (1, 2))
    return KnownFold(parameters, family, fold, h_uu, h_utau)


def follow_fold(known: KnownFold, parameters: Parameters) -> KnownFold | None:
    """The same fold when something else is flown; None if it is not found near by."""
    family = known.family
    # The fold itself moves little in absolute terms: its tau shifts by what has been flown.
    if family is ANGULAR_RATE:
        flown = log(parameters.omega / known.parameters.omega)
    else:
        flown = log(known.parameters.length / parameters.length)
    start = tau, u = known.fold.tau - flown, log(known.fold.end_mass_radius)
    for _ in range(_ITERATIONS):
        values = _level(parameters, family, tau, u)
        if values is None:
            break
        h, h_u, h_tau = values
        determinant = h_tau * known.h_uu - h_u * known.h_utau
        if determinant == 0.0:
            break
        d_tau = (-h * known.h_uu + h_u * h_u) / determinant
        d_u = (-h_tau * h_u + known.h_utau * h) / determinant
        if abs(d_tau) > 0.2 or abs(d_u) > 0.2:
            break
        tau, u = tau + d_tau, u + d_u
        if abs(d_tau) < _CONVERGED[0] and abs(d_u) < _CONVERGED[1]:
            return KnownFold(parameters, family, Fold(tau, exp(u)), known.h_uu, known.h_utau)
    tau, u, good = correct_fold(
        parameters.theta(), family.exponents(), parameters.length, family.length, *start, TOLERANCE
    )
    return known_fold(parameters, family, Fold(tau, exp(u))) if good else None


def _level(
    parameters: Parameters, family: Family, tau: float, u: float
) -> tuple[float, float, float] | None:
    """h, dh/du and dh/dtau; None where the cable cannot be integrated."""
    h, h_u, h_tau, status = level(
        parameters.theta(), family.exponents(), parameters.length, family.length, tau, u,
        TOLERANCE, np.empty((1, 3, 6)), np.empty(MAX_STEPS + 1),
    )
    return (h, h_u, h_tau) if status == OK else None
