"""The vehicle's clock made continuous, and tied once a flight to Unix time.

Positions are timed by the vehicle's clock (time since boot), never by their arrival: links delay
and bunch messages by seconds. That clock wraps at 2^32 ms and starts anew at each boot, so it is
unwrapped here, and a boot begins a new flight.
"""

from collections import Counter

# Messages overtake each other by up to this on real links; a larger step back is a reboot.
LATE_US = 2_000_000
# A step ahead is a link gap when the receive stamps saw the time pass, give or take this much:
# a message that comes at once after one that came late. Recorded links show up to 0.75 s.
GAP_TOLERANCE_US = 2_500_000
# A step ahead that no receive stamp can tell of is a gap up to this: no flight pauses for a day.
LONGEST_GAP_US = 86_400_000_000
# How far the clock moves on at a reboot when no receive stamp tells.
LEAST_STEP_US = 1_000
# Unix time before 2000 is that of an unset clock; after 2038 it is damage, and fits no ROS stamp.
EARLIEST_UNIX_US = 946_684_800_000_000
LATEST_UNIX_US = 2**31 * 1_000_000


class VehicleClock:
    """Continuous time and Unix time of one vehicle, in integer microseconds.

    Attributes
    ----------
    flight : int
        Rises by one at each reboot, and at each step ahead that the receive stamps do not support
        or, where there are none, of more than a day.
    unix_anchor : (int, int) or None
        As the parameter, or the first that `set_unix` was told.
    told_unix_offset_us : int or None
        Unix time less continuous time as told last in the present flight: for comparing clocks,
        where the offset of the stamps must not change.

    Parameters
    ----------
    wrap_us : int, optional
        Period of the vehicle's counter; None if it does not wrap.
    time_steps : Counter, optional
        Where "wrap", "reboot" and "jump" are counted.
    unix_anchor : (int, int), optional
        A continuous time [us] and its Unix time [us], where known before the first message.
    """

    def __init__(
        self,
        wrap_us: int | None = None,
        time_steps: Counter | None = None,
        unix_anchor: tuple[int, int] | None = None,
    ):
        self.flight = 0
        self.unix_anchor = unix_anchor
        self.told_unix_offset_us: int | None = None
        self._wrap_us = wrap_us
        self._time_steps = Counter() if time_steps is None else time_steps
        self._boot_us: int | None = None  # the counter at the newest message
        self._time_us = 0  # continuous time of the newest message
        self._receive_us: int | None = None  # its receive stamp
        self._unix_offset_us: int | None = None  # Unix time less continuous time
        if unix_anchor is not None:
            self.set_unix(*unix_anchor)

    def advance(self, boot_us: int, receive_us: int | None = None) -> int:
        """Continuous time of a message.

        Parameters
        ----------
        boot_us : int
            The vehicle's counter in the message.
        receive_us : int, optional
            When it was received (Unix time); None where that was not recorded. Taken as not
            recorded outside the years 2000 to 2038.

        Returns
        -------
        int
            Microseconds; a late message (up to 2 s) gets its own, earlier time.
        """
        if not is_unix(receive_us):
            receive_us = None
        if self._boot_us is None:
            # No clock is past 2038, since boot or since 1970: a damaged one begins at 0.
            self._newest(boot_us, boot_us if boot_us < LATEST_UNIX_US else 0, receive_us)
            return self._time_us
        step = boot_us - self._boot_us
        if self._wrap_us:
            half = self._wrap_us // 2
            step = (step + half) % self._wrap_us - half
        elapsed = None
        if receive_us is not None and self._receive_us is not None:
            elapsed = receive_us - self._receive_us

        longest = LONGEST_GAP_US if elapsed is None else max(elapsed, 0) + GAP_TOLERANCE_US
        if step < -LATE_US:
            event = "reboot"
        elif step > longest:
            event = "jump"
        elif step < 0:
            return self._time_us + step
        else:
            event = "wrap" if boot_us < self._boot_us else None

        if event:
            self._time_steps[event] += 1
        if event in ("reboot", "jump"):
            self.flight += 1
            self._unix_offset_us = self.told_unix_offset_us = None
            step = max(elapsed or 0, LEAST_STEP_US)
        self._newest(boot_us, self._time_us + step, receive_us)
        return self._time_us

    def set_unix(self, time_us: int, unix_us: int) -> None:
        """Tie the flight's stamps to Unix time, once; without effect outside 2000 to 2038."""
        if not is_unix(unix_us):
            return
        self.told_unix_offset_us = unix_us - time_us
        self.unix_anchor = self.unix_anchor or (time_us, unix_us)
        if self._unix_offset_us is None:
            self._unix_offset_us = unix_us - time_us

    def stamp_ns(self, time_us: int, receive_us: int | None = None) -> int:
        """Nanoseconds since the Unix epoch of a continuous time of the present flight.

        The first call in a flight not tied yet ties it to `receive_us` for good, or, without one,
        to the epoch itself; so stamps advance exactly as the vehicle's clock does.
        """
        if self._unix_offset_us is None:
            self._unix_offset_us = receive_us - time_us if is_unix(receive_us) else 0
        return (time_us + self._unix_offset_us) * 1000

    def _newest(self, boot_us: int, time_us: int, receive_us: int | None) -> None:
        self._boot_us, self._time_us, self._receive_us = boot_us, time_us, receive_us


def is_unix(time_us: int | None) -> bool:
    """Whether a number of microseconds can be a Unix time of 2000 to 2038."""
    return time_us is not None and EARLIEST_UNIX_US < time_us < LATEST_UNIX_US
