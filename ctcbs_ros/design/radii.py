"""The tow radii at which everything is met, at one speed: intervals, their ends by bisection."""

from itertools import pairwise

from ctcbs_ros.design.envelope import envelope_row, grid_lines
from ctcbs_ros.design.evaluation import Evaluation

_RADII = 33
_ERROR = 1e-3


def good_radii(evaluation: Evaluation, speed: float) -> tuple[tuple[float, float], ...]:
    """Intervals of tow radius [m] within the envelope that are good with all of the cable out.

    Parameters
    ----------
    evaluation : Evaluation
    speed : float
        [m/s]

    Returns
    -------
    tuple of (float, float)
        An interval that lies wholly between two of 33 equally spaced radii is not seen.
    """
    configuration, density = evaluation.configuration, evaluation.density

    def good(radius: float) -> bool:
        (point,) = envelope_row(configuration, density, radius, (speed,))
        return not evaluation.violations(point)

    radii = [float(radius) for radius in grid_lines(configuration.envelope.radius, _RADII)]
    verdicts = [good(radius) for radius in radii]
    edges = [radii[0]] if verdicts[0] else []
    for (a, was), (b, becomes) in pairwise(zip(radii, verdicts, strict=True)):
        if was != becomes:
            edges.append(_edge(good, a, b) if was else _edge(good, b, a))
    if verdicts[-1]:
        edges.append(radii[-1])
    return tuple(zip(edges[::2], edges[1::2], strict=True))


def _edge(good, inside: float, outside: float) -> float:
    """The last good radius on the way from a good one to a bad one."""
    while abs(outside - inside) > _ERROR * inside:
        middle = 0.5 * (inside + outside)
        if good(middle):
            inside = middle
        else:
            outside = middle
    return inside
