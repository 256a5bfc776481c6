"""Why the motion in a wind is not known, in words that a pilot can act on."""

import re
from math import isfinite

from ctcbs_ros.periodic.solve import Found
from ctcbs_ros.twin.turns import Flown

STILL_SOLVED = "the motion in this wind is still being solved"
NO_STRETCH = "only of a cable that stretches is the motion in wind known: set cable.youngs_modulus"
ALONE = "next to this wind, radius and speed there is no motion"
STILL_JUDGED = "it is still being computed"
NO_TIME = (
    "radius, speed or wind keep changing before it is computed; hold the circle for half a turn"
)
_WHAT_TO_DO = "fly a wider circle or wait for less wind"

# Why it is not known how stable a motion is.
COARSE = f"it takes more of the motion than is solved; {_WHAT_TO_DO}"
NOT_CONVERGED = f"it does not converge, a finer computation gives another margin; {_WHAT_TO_DO}"


def not_found(found: Found, wind: float, speed: float) -> str:
    """Why a search gave no motion in a wind, past a circle flown at a mean speed [m/s]."""
    why = found.reason
    if found.reached is not None:
        why = f"one is found up to {found.reached.air_velocity:.2f}"
        if found.nearly_slack:
            why += ", where the cable goes slack"
    elif isfinite(found.uncertain):
        why = f"it is not known to better than {found.uncertain:.2f} of the tow radius"
    return (
        f"no motion found in this wind, {wind / speed:.2f} of the mean speed along the circle "
        f"({speed:.1f} m/s): {why}; {_WHAT_TO_DO}"
    )


def not_repeating(flown: Flown, wind: float, speed: float) -> str:
    """The same of a cable flown in time, where its turns do not come to the same."""
    why = flown.reason or ALONE
    if isfinite(flown.greatest_distance) and flown.motion is None:
        why = (
            f"the end mass keeps changing its way from turn to turn, between "
            f"{flown.least_distance:.2f} and {flown.greatest_distance:.2f} tow radii from the "
            "circle's axis"
        )
    return (
        f"no steady motion in this wind, {wind / speed:.2f} of the mean speed along the circle "
        f"({speed:.1f} m/s): {why}; {_WHAT_TO_DO}"
    )


def kind_of_reason(reason: str) -> str:
    """A reason without its numbers, which change with the flight."""
    return re.sub(r"\d+(\.\d+)?(e[-+]?\d+)?", "#", reason)
