"""What is flown: the tow point's path from sample to sample, through gaps, or that it is lost."""

from dataclasses import dataclass
from math import isfinite, nan, pi

import numpy as np

from ctcbs_ros.configuration import Configuration
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.twin.course import Course, through_gap
from ctcbs_ros.twin.seen import Seen
from ctcbs_ros.twin.simulated import Loss
from ctcbs_ros.twin.tow_point import TAKEN_OVER, Pieces, TowPoint

# A gap is flown through along the orbit for this part of a turn, off any orbit for this time [s].
_COAST, _COAST_STRAIGHT = 0.5, 3.0
# Time between samples that is a gap [s]: what a correction takes to come in, all but a tenth.
_GAP = 4.0 * TAKEN_OVER
# What a gap's end is off the orbit is known there, and by half of that in its middle.
_IN_BETWEEN = 0.5
# A sample is not where the path leads from this distance on [m], [standard deviations], and
# [the way flown since the sample before].
_JUMP, _JUMP_SIGMA, _JUMP_PART = 20.0, 8.0, 0.3
# Straight flight: a velocity that changes by less than this part of it for so long [s], at this
# part of the envelope's lowest speed at least.
_STRAIGHT, _STRAIGHT_TIME, _FLYING = 0.15, 5.0, 0.5


@dataclass(frozen=True)
class Stretch:
    """The path from the sample before.

    Attributes
    ----------
    path : Pieces
    unsure : (3,) ndarray
        Standard deviation of it between its ends, as a vector: how a gap's path may have led
        elsewhere [m].
    """

    path: Pieces
    unsure: np.ndarray


class FlownPath:
    """Follows the tow point.

    Parameters
    ----------
    configuration : Configuration
    """

    def __init__(self, configuration: Configuration):
        self._receiver = configuration.receiver
        self._slowest = _FLYING * configuration.envelope.speed[0]
        self.tow: TowPoint | None = None
        self.forget()

    def forget(self) -> None:
        """Begin anew with the next sample."""
        self.tow = None
        self._straight_since, self._straight_velocity = nan, np.zeros(2)

    def is_straight(self, time: float) -> bool:
        """Whether straight flight has lasted for long enough."""
        return time - self._straight_since >= _STRAIGHT_TIME

    def variances(self, sample: Sample) -> np.ndarray:
        """Of the path's end, (3,) [m^2]; what is correlated in time no filter takes out."""
        stays = self._receiver.correlated_share * self._sigmas(sample)[0]
        return self.tow.variances + stays**2

    def velocity_sigma(self, sample: Sample) -> float:
        """Of one axis [m/s]."""
        return self._sigmas(sample)[1]

    def add(
        self, seen: Seen, interval: float, orbit: Orbit | None, at: float, wind: np.ndarray
    ) -> Stretch | Loss | None:
        """Take in a sample.

        Parameters
        ----------
        seen : Seen
        interval : float
            Since the sample before [s].
        orbit : Orbit or None
            That is flown on, as it was known then.
        at : float
            Time of the sample before [s].
        wind : (3,) ndarray
            [m/s]

        Returns
        -------
        Stretch, Loss or None
            None of the first sample.
        """
        longest = _COAST * 2.0 * pi / orbit.angular_rate if orbit else _COAST_STRAIGHT
        gone = self.tow is not None and interval > longest
        if gone:
            self.tow = None
        sample = seen.sample
        position, velocity, sigmas = seen.tow_point, sample.velocity, self._sigmas(sample)
        if self.tow is None:
            self.forget()
            if velocity is not None:
                self.tow = TowPoint(position, velocity, *sigmas)
            return Loss.GAP if gone else None
        before = self._end
        path, missed, sigma = self.tow.add(
            interval, position, velocity, *sigmas, orbit.angular_rate if orbit else 0.0,
            wind if orbit else np.zeros(3),
        )  # fmt: skip
        flown = interval * float(np.linalg.norm(self.tow.velocity))
        if missed > max(_JUMP, _JUMP_SIGMA * sigma, _JUMP_PART * flown):
            self.forget()
            return Loss.JUMP
        self._note_straight_flight(sample.time)
        if interval <= _GAP:
            return Stretch(path, np.zeros(3))
        course = Course(orbit, wind[:2], seen.at_airspeed) if orbit else None
        path, off = through_gap(
            interval, before, self._end, course, at - orbit.time if orbit else 0.0
        )
        return Stretch(path, _IN_BETWEEN * off if orbit else np.zeros(3))

    @property
    def _end(self) -> np.ndarray:
        return np.stack([self.tow.position, self.tow.velocity])

    def _sigmas(self, sample: Sample) -> tuple[float, float]:
        return (
            _stated(sample.horizontal_accuracy, self._receiver.position_sigma),
            _stated(sample.speed_accuracy, self._receiver.velocity_sigma),
        )

    def _note_straight_flight(self, time: float) -> None:
        velocity = self.tow.velocity[:2]
        speed = float(np.hypot(*velocity))
        if speed < self._slowest:
            self._straight_since = nan
        elif not (
            isfinite(self._straight_since)
            and np.hypot(*(velocity - self._straight_velocity)) < _STRAIGHT * speed
        ):
            self._straight_since, self._straight_velocity = time, velocity


def _stated(sigma: float, otherwise: float) -> float:
    """A stated standard deviation where there is one that can be used."""
    return min(sigma, 1e3) if sigma > 0.0 else otherwise
