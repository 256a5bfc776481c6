"""What counts as an orbit, and the errors assumed where a source states none."""

from dataclasses import dataclass
from math import pi

TURN = 2.0 * pi


@dataclass(frozen=True)
class OrbitSettings:
    """What counts as an orbit, and the errors assumed where a source states none.

    Attributes
    ----------
    window : float
        Angle of the course that the window covers [rad]; a little over a turn averages a
        once-per-orbit variation of the speed.
    least_arc : float
        Least angle about the centre for a valid orbit [rad]. The ends of a racetrack are circles
        of half a turn.
    confirming_arc : float
        Least angle instead [rad] after a long turn the other way, or after a circle that was left
        before it was flown so far: the loops of a figure of eight, the ends of a racetrack.
    position_sigma, velocity_sigma : float
        Standard deviations of one axis where the source states none [m], [m/s].
    correlated_share : float
        Share of the standard deviation of a position, stated or not, that is correlated in time;
        the rest is white: s^2 = (share s)^2 + (1 - share^2) s^2. Nought is white noise alone.
    correlation_time : float
        Time in which that correlation falls to 1/e [s] (first-order Gauss-Markov).
    least_sigma : float
        Smallest standard deviation of a position believed [m]: an autopilot does not hold a circle
        better than this.
    least_velocity_sigma : float
        Smallest standard deviation of a velocity believed [m/s].
    residual_share : float
        Largest root mean square distance from the circle, over its radius, beyond the noise.
    trend_share : float
        Largest change of the radius in one turn, over the radius; more is a spiral. It must
        exceed this by one to two of its standard deviations.
    drift_arc : float
        Least angle about the centre for which a drift of the circle is fitted [rad]: over less it
        is hardly told from another radius, and fitting it would cost the others' accuracy.
    drift_share : float
        Drift in one turn, over the radius, below which a circle is taken to stand still.
    speed_share : float
        Largest variation (rms) of the speed relative to a drifting centre, over its mean: such a
        circle is flown in the air that it drifts with.
    known_share : float
        Standard deviation of the radius, over it, from which a circle is not known well enough to
        predict from: its 95 % interval is then 30 % either way. Half a turn of 40 m in noise of
        5 m is just known so well. The rate has no such limit: in wind half a turn does not tell
        the mean one.
    minimum_radius, maximum_radius : float
        [m]
    minimum_speed : float
        [m/s]
    longest_gap : float
        Time without a sample after which the window starts anew [s].
    most_samples : int
        Samples in the window; at higher rates every second, third, ... is used.
    """

    window: float = 1.1 * TURN
    least_arc: float = 0.46 * TURN
    confirming_arc: float = 0.95 * TURN
    position_sigma: float = 2.0
    velocity_sigma: float = 0.4
    correlated_share: float = 0.97
    correlation_time: float = 45.0
    least_sigma: float = 0.3
    least_velocity_sigma: float = 0.05
    residual_share: float = 0.03
    trend_share: float = 0.08
    drift_arc: float = 0.7 * TURN
    drift_share: float = 0.02
    speed_share: float = 0.1
    known_share: float = 0.15
    minimum_radius: float = 5.0
    maximum_radius: float = 20e3
    minimum_speed: float = 3.0
    longest_gap: float = 30.0
    most_samples: int = 240
