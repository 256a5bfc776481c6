"""What a reader reports about its link: which vehicle it follows, and what it lost on the way."""

from collections import Counter
from dataclasses import dataclass, field

# A sequence number that stands up to 64 behind the expected one is a late or repeated message, not
# a loss of 192 to 255 messages in a row: the 8-bit counter alone cannot tell the two apart.
LARGEST_GAP = 191
ALL_LATE = (1 << 256 - LARGEST_GAP - 1) - 1  # a bit for each late message that can be told


@dataclass(frozen=True)
class Vehicle:
    """The sender that is followed: MAVLink ids, and its type in words ("fixed wing")."""

    system: int
    component: int
    type: str


@dataclass
class LinkStatistics:
    """Counts over everything that was read; a log and a live link are counted alike.

    Attributes
    ----------
    messages : int
        Messages decoded, of every sender.
    bad_runs, bad_bytes : int
        Stretches of bytes that belong to no intact message, and their length in all.
    received, lost, repeated : Counter
        Messages received, lost and received again (by the sequence number), by (system,
        component). One that was overtaken is not lost.
    positions_of_others : Counter
        Position messages not used, by the system that sent them: another vehicle, or before one
        was chosen.
    time_steps : Counter
        Steps of the vehicle's clock: "wrap" (made continuous), "reboot" and "jump" (each begins a
        new flight).
    in_step : bool
        Whether the newest bytes were a message.
    """

    messages: int = 0
    bad_runs: int = 0
    bad_bytes: int = 0
    received: Counter = field(default_factory=Counter)
    lost: Counter = field(default_factory=Counter)
    repeated: Counter = field(default_factory=Counter)
    positions_of_others: Counter = field(default_factory=Counter)
    time_steps: Counter = field(default_factory=Counter)
    in_step: bool = True
    _last_sequence: dict = field(default_factory=dict, repr=False)
    # Of the newest sequence number and those before it, as bits from the lowest, which came.
    _came: Counter = field(default_factory=Counter, repr=False)

    @property
    def other_positions(self) -> int:
        """Position messages not used, of all systems."""
        return self.positions_of_others.total()

    def count_message(self) -> None:
        """One more message was decoded; bad bytes after it are a new run."""
        self.messages += 1
        self.in_step = True

    def count_bad_bytes(self, count: int) -> None:
        """That many more bytes belong to no message."""
        if count > 0:
            self.bad_runs += self.in_step
            self.bad_bytes += count
            self.in_step = False

    def count_sequence(self, source: tuple[int, int], sequence: int) -> None:
        """One more message of that (system, component), with its 8-bit sequence number."""
        self.received[source] += 1
        gap = (sequence - self._last_sequence.get(source, sequence - 1) - 1) % 256
        if gap <= LARGEST_GAP:
            self.lost[source] += gap
            self._last_sequence[source] = sequence
            self._came[source] = (self._came[source] << gap + 1 | 1) & ALL_LATE
            return
        this = 1 << 255 - gap
        if self._came[source] & this:
            self.repeated[source] += 1
        elif self.lost[source]:  # none before the first message is missed
            self.lost[source] -= 1
        self._came[source] |= this
