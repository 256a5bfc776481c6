"""Whether reports out of the cable's reach tell that the cable's length is set wrong.

A glitch takes a beacon out of reach for moments. Of a cable longer than `cable.length` it is out
of reach for a good part of each turn, however good its positions are.
"""

from collections.abc import Mapping

from ctcbs_ros.beacon.comparison import Standing, Unmatched

# Share of the reports that the reach was judged of, and their number, from which it is no glitch.
_SHARE, _LEAST = 0.1, 10
LENGTH_HINT = "check cable.length (or whether this is the payload's beacon)"


def share_out_of_reach(outcomes: Mapping) -> float | None:
    """Share of reports out of reach, where it puts the cable's length in doubt.

    Parameters
    ----------
    outcomes : Mapping
        Counts by `Comparison.outcome`.

    Returns
    -------
    float or None
        0 to 1, of the reports beside which the aircraft was; None where it is no more than
        glitches are.
    """
    out = outcomes.get(Unmatched.OUT_OF_REACH, 0)
    within = sum(outcomes.get(code, 0) for code in (*Standing, Unmatched.NO_PREDICTION))
    doubted = out >= max(_LEAST, _SHARE * (out + within))
    return out / (out + within) if doubted else None
