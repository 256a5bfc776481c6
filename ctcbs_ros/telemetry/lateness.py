"""How late samples arrive on a live link, beyond the least delay that it has shown."""

from ctcbs_ros.telemetry.sample import Sample

# The two clocks drift apart by less than this.
DRIFT = 1e-4


class Lateness:
    """Compares the clock of the vehicle with that of the receiver, sample by sample.

    Attributes
    ----------
    seconds : float
        How much later than at the least delay of late the newest sample came; 0 before any.
    samples : int
        Of the present flight.
    """

    def __init__(self):
        self.seconds = 0.0
        self.samples = 0
        self._flight: int | None = None
        self._newest = 0.0  # sample, by the vehicle's clock
        self._least = 0.0  # receiver's clock less the vehicle's at the least delay
        self._received = 0.0
        self._sum = 0.0

    @property
    def offset(self) -> float:
        """The receiver's clock less the vehicle's, at the least delay of late [s]."""
        return self._least

    @property
    def uncertainty(self) -> float:
        """By how much the least of so many delays exceeds the least there can be, about [s].

        Exact in the mean for delays spread exponentially above it; what every message is late by
        does not show.
        """
        return self._sum / self.samples**2 if self.samples else 0.0

    def add(self, sample: Sample, received: float) -> None:
        """Take in a sample and when it was received, by a steady clock [s]."""
        offset = received - sample.time
        if sample.flight != self._flight:
            self._flight, self._least = sample.flight, offset
            self.samples, self._sum = 0, 0.0
        elif sample.time <= self._newest:  # overtaken or sent again
            return
        self._newest = sample.time
        self._least = min(offset, self._least + DRIFT * (received - self._received))
        self._received = received
        self.seconds = offset - self._least
        self.samples += 1
        self._sum += self.seconds
