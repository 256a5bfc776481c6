"""ROS 2 bags to samples: a rosbag2 folder, or one of its files, SQLite (.db3) or MCAP.

Nothing of ROS needs to be installed: rosbags reads the messages, by its own definitions of their
types, never by those in the bag (which it would compile). A bag is read as it comes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from rosbags.typesys import Stores, get_typestore

from ctcbs_ros.errors import InputError
from ctcbs_ros.telemetry.beacon import STAMPS, BeaconSample, CommonTime, stamp_offset
from ctcbs_ros.telemetry.clock import VehicleClock
from ctcbs_ros.telemetry.link import LinkStatistics
from ctcbs_ros.telemetry.rosbag_storage import Raw, Storage, file_class, open_storages
from ctcbs_ros.telemetry.sample import Sample, Vector
from ctcbs_ros.telemetry.topics import POSE, TopicSamples

# Samples in which a bag shows what kinds of position it has.
HEAD_SAMPLES = 1000


@dataclass(frozen=True)
class Role:
    """What a topic is for: its message type, its names by preference, and who takes it in."""

    type: str
    names: tuple[str, ...]
    handler: str  # of TopicSamples
    gives_position: bool
    only_named: str = ""  # a topic of another name must have this in it


ROLES = (
    Role(
        "sensor_msgs/msg/NavSatFix",
        ("/mavros/global_position/global", "/fix", "/mavros/global_position/raw/fix"),
        "fix",
        True,
    ),
    Role("nav_msgs/msg/Odometry", ("/mavros/local_position/odom", "/odom"), "odometry", True),
    Role("geometry_msgs/msg/PoseStamped", ("/mavros/local_position/pose",), "pose", True),
    Role(
        "geometry_msgs/msg/TwistStamped",
        ("/mavros/local_position/velocity_local", "/mavros/global_position/raw/gps_vel"),
        "twist",
        False,
    ),
    # Receivers publish their velocity as the same type.
    Role(
        "geometry_msgs/msg/TwistWithCovarianceStamped",
        ("/mavros/wind_estimation",),
        "wind_estimation",
        False,
        only_named="wind",
    ),
)

BEACON = Role("sensor_msgs/msg/NavSatFix", (), "fix", False)


class BagSource:
    """A bag: iterate over it for its samples, from the start each time.

    Parameters
    ----------
    path : Path
    storages : list
        Its files in order.
    used : dict
        Role of each topic used, by name; `BEACON` for that of the beacon.

    Attributes
    ----------
    path : Path
    size : int
        Bytes.
    link : LinkStatistics
        Counts over what has been read.
    vehicle : None
        A bag does not name its vehicle.
    beacon : None
        Nor its beacon.
    beacon_link : LinkStatistics or None
        Counts of the beacon's messages; None without one.
    progress : float
        Part of the bag that has been read, 0 to 1.
    is_empty : bool
        Whether there is not one sample in it.
    """

    vehicle = beacon = None

    def __init__(self, path: Path, storages: list[Storage], used: dict[str, Role]):
        self.path = path
        self.size = sum(storage.size for storage in storages)
        self._storages = storages
        self._used = used
        self._types = get_typestore(Stores.ROS2_JAZZY)
        # What kinds of position there are shows soon; the best is then used from the start.
        self._best = POSE
        head = list(islice(self, HEAD_SAMPLES))
        self.is_empty = not any(isinstance(sample, Sample) for sample in head)
        self._best = self._samples.best
        self._begin()

    @property
    def wind(self) -> Vector | None:
        """Wind by the autopilot at the newest sample, velocity towards east, north, up [m/s]."""
        return self._samples.wind

    def _begin(self) -> None:
        self.link = LinkStatistics()
        self.progress = 0.0
        self._samples = TopicSamples(VehicleClock(time_steps=self.link.time_steps), self._best)
        self.beacon_link = LinkStatistics() if BEACON in self._used.values() else None
        if self.beacon_link is not None:
            clock = VehicleClock(time_steps=self.beacon_link.time_steps)
            self._of_beacon, self._time = TopicSamples(clock), CommonTime(STAMPS)

    def __iter__(self) -> Iterator[Sample | BeaconSample]:
        self._begin()
        before = 0
        for storage in self._storages:
            roles = {
                topic.id: self._used[topic.name]
                for topic in storage.topics
                if topic.name in self._used and self._used[topic.name].type == topic.type
            }
            for raw in storage.messages(set(roles), self.link):
                self.progress = (before + raw.progress * storage.size) / self.size
                sample = self._taken(roles[raw.id], raw)
                if sample is not None:
                    yield sample
            before += storage.size
        self.progress = 1.0

    def _taken(self, role: Role, raw: Raw) -> Sample | BeaconSample | None:
        try:
            message = self._types.deserialize_cdr(raw.data, role.type)
        except Exception:  # whatever damaged bytes lead to
            self.link.count_bad_bytes(len(raw.data))
            return None
        self.link.count_message()
        receive_us = raw.receive_ns // 1000
        if role is BEACON:
            sample = self._of_beacon.fix(message, receive_us)
            return self._time.tie(sample, receive_us / 1e6, stamp_offset(sample))
        sample = getattr(self._samples, role.handler)(message, receive_us)
        if sample is not None and self.beacon_link is not None:
            self._time.hear_aircraft(sample, receive_us / 1e6, stamp_offset(sample))
        return sample


def is_bag(path: Path) -> bool:
    """Whether a path is a folder, or a file that begins like a bag."""
    return path.is_dir() or file_class(path) is not None


def open_bag(path: Path, beacon: str = "") -> BagSource:
    """Open a rosbag2 folder, or a file of one.

    Topics are taken by their mavros names (`ROLES`), else the only one of its type; that of the
    beacon (a NavSatFix), where one is given, is never the aircraft's.

    Raises
    ------
    InputError
        If there is nothing to read, or no topic that tells where the aircraft is.
    """
    storages = open_storages(path)
    if not storages:
        raise InputError(f"log {path}: no rosbag2 file (.db3 or .mcap) in it that can be read")
    topics = {topic for storage in storages for topic in storage.topics}
    used: dict[str, Role] = {}
    beacon = f"/{beacon.lstrip('/')}" if beacon else ""
    for role in ROLES:
        name = _chosen(role, {t.name for t in topics if t.type == role.type and t.name != beacon})
        if name is not None:
            used[name] = role
    if not any(role.gives_position for role in used.values()):
        found = ", ".join(sorted({f"{topic.name} ({topic.type})" for topic in topics})[:10])
        raise InputError(
            f"log {path}: no topic tells the aircraft's position; needed: NavSatFix, Odometry or "
            f"PoseStamped, by its mavros name or the only one of its type; found: "
            f"{found or 'none'}"
        )
    if beacon:
        fixes = sorted(topic.name for topic in topics if topic.type == BEACON.type)
        if beacon not in fixes:
            raise InputError(
                f"log {path}: beacon.topic: no NavSatFix {beacon} in it; it has: "
                f"{', '.join(fixes[:10]) or 'none'}"
            )
        used[beacon] = BEACON
    source = BagSource(path, storages, used)
    if source.is_empty:
        raise InputError(f"log {path}: no message of {', '.join(used)} that can be read")
    return source


def _chosen(role: Role, names: set[str]) -> str | None:
    """The topic of a role among those of its type."""
    for name in role.names:
        if name in names:
            return name
    names = {name for name in names if role.only_named in name}
    return names.pop() if len(names) == 1 else None
