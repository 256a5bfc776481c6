"""A beacon that the payload carries: whose it is, and its samples by the aircraft's clock.

Two systems' clocks have nothing to do with each other: each counts from its own boot. They are
tied by the Unix time that both tell, or else by when their messages were received, each at its
least delay.
"""

from dataclasses import dataclass
from math import hypot, nan

from ctcbs_ros.telemetry.lateness import Lateness
from ctcbs_ros.telemetry.sample import Sample

# Messages of each system until the least of their delays tells something.
ENOUGH = 5
# Unix times that disagree with the receive times by more than the first [s] are one way or the
# other wrong by that; by more than the second they are those of a clock that was never set, or
# counts no leap seconds.
DOUBT, UNSET = 1.0, 10.0
UNIX, RECEIVED, ORDER, STAMPS = "Unix time", "receive times", "order received", "header stamps"


@dataclass(frozen=True)
class BeaconWanted:
    """Whose samples are the beacon's: a MAVLink system (and component), or a topic.

    `component` None stands for the first of the system that sends positions.
    """

    system: int | None = None
    component: int | None = None
    topic: str = ""


def beacon_wanted(system: int, component: int, topic: str) -> BeaconWanted | None:
    """The beacon of parameters in which 0 and an empty topic stand for none; None without one."""
    if not (system or topic):
        return None
    return BeaconWanted(system or None, component or None, topic)


@dataclass(frozen=True, slots=True)
class BeaconSample:
    """One position report of the beacon, never to be taken for one of the aircraft's.

    Attributes
    ----------
    sample : Sample
        By the beacon's own clock and flights.
    time : float
        The same instant by the aircraft's clock [s]; nan as long as the two are not tied.
    time_sigma : float
        Standard deviation of it, as far as the messages tell [s].
    time_by : str
        What ties the clocks: "Unix time", "receive times", "order received" (of a log without
        receive stamps), "header stamps"; empty where nothing does.
    flight : int
        Of the aircraft then.
    """

    sample: Sample
    time: float = nan
    time_sigma: float = nan
    time_by: str = ""
    flight: int = -1


class CommonTime:
    """Ties a beacon's clock to the aircraft's, from the samples of both as they come.

    Parameters
    ----------
    common : str
        What the time common to both is, where both tell one: Unix time, or that of header stamps.
    """

    def __init__(self, common: str = UNIX):
        self._common = common
        self._aircraft, self._beacon = Lateness(), Lateness()
        self._newest: Sample | None = None
        self._interval = nan  # between the newest two of the aircraft
        self._aircraft_unix: float | None = None
        self._has_stamps = False

    def hear_aircraft(
        self, sample: Sample, received: float | None, unix_offset: float | None
    ) -> None:
        """Take in one of the aircraft's samples.

        Parameters
        ----------
        sample : Sample
        received : float or None
            When it was received, by the clock that receives the beacon too [s].
        unix_offset : float or None
            Common time less the sample's time, where the aircraft told [s].
        """
        before = self._newest
        if before is None or before.flight != sample.flight or sample.time > before.time:
            same = before is not None and before.flight == sample.flight
            self._interval = sample.time - before.time if same else nan
            self._newest = sample
        self._has_stamps = received is not None
        self._aircraft.add(sample, sample.time if received is None else received)
        self._aircraft_unix = unix_offset

    def tie(
        self, sample: Sample, received: float | None, unix_offset: float | None
    ) -> BeaconSample:
        """One of the beacon's samples with its time on the aircraft's clock; as above."""
        newest = self._newest
        if newest is None or (received is not None) != self._has_stamps:
            return BeaconSample(sample)
        self._beacon.add(sample, newest.time if received is None else received)
        by_order = received is None
        shift = sigma = None
        if min(self._aircraft.samples, self._beacon.samples) >= ENOUGH:
            shift = self._beacon.offset - self._aircraft.offset
            sigma = hypot(self._beacon.uncertainty, self._aircraft.uncertainty)
            if by_order:  # received at any time until the aircraft's next
                sigma = hypot(sigma, self._interval)
        by = ORDER if by_order else RECEIVED
        if unix_offset is not None and self._aircraft_unix is not None:
            by_unix = unix_offset - self._aircraft_unix
            off = 0.0 if shift is None else abs(by_unix - shift)
            if off <= DOUBT or (by_order and off <= DOUBT + self._interval):
                shift, sigma, by = by_unix, 0.0, self._common
            elif off <= UNSET:
                sigma = hypot(sigma, off)
        if shift is None:
            return BeaconSample(sample)
        return BeaconSample(sample, sample.time + shift, sigma, by, newest.flight)


def stamp_offset(sample: Sample) -> float:
    """The stamp of a sample less its time [s]."""
    return sample.stamp_ns / 1e9 - sample.time
