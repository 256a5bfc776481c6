"""The topics that the node publishes."""

import json
from math import ceil

from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from sensor_msgs.msg import NavSatFix
from std_msgs.msg import Float64, String
from visualization_msgs.msg import Marker, MarkerArray

from ctcbs_ros.geodesy import Datum
from ctcbs_ros.nodes import messages
from ctcbs_ros.nodes.markers import Name, cable_markers, deletions
from ctcbs_ros.prediction.prediction import Prediction
from ctcbs_ros.prediction.record import prediction_record

# What a publisher keeps for a subscriber that falls behind. No more, so that one with the usual
# depth of 10 keeps up with a log; and a full queue makes Fast DDS ask for acknowledgements at once
# instead of every 3 s.
DEPTH = 10
ACKNOWLEDGEMENT = Duration(nanoseconds=10_000_000)  # waited for at a time
LEAST_LIFETIME = 5  # s, of a marker


class Output:
    """One reliable topic, with a count of what its subscribers may not have received yet."""

    def __init__(self, node: Node, message_type: type, topic: str, qos: QoSProfile | int = DEPTH):
        self._publisher = node.create_publisher(message_type, topic, qos)
        self._unconfirmed = 0

    @property
    def awaited(self) -> bool:
        """Whether anyone subscribes."""
        return self._publisher.get_subscription_count() > 0

    def publish(self, message) -> None:
        """Publish a message."""
        self._publisher.publish(message)
        self._unconfirmed += 1

    def has_room(self) -> bool:
        """Whether the next message would not displace one that is not received."""
        return self._unconfirmed < DEPTH or self.is_received()

    def is_received(self) -> bool:
        """Whether every reliable subscriber has received everything; waits a little for it."""
        if self._unconfirmed and self._publisher.wait_for_all_acked(ACKNOWLEDGEMENT):
            self._unconfirmed = 0
        return self._unconfirmed == 0


class Outputs:
    """Publishers of the predictions.

    Parameters
    ----------
    node : Node
    frame_id : str
        Frame of what is published.
    with_cable : bool
        Whether markers are published.
    """

    def __init__(self, node: Node, frame_id: str, with_cable: bool):
        self._frame_id = frame_id
        self._with_cable = with_cable
        self._shown: set[Name] = set()  # markers that stand
        self._datum: Datum | None = None

        latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        self._pose = Output(node, PoseWithCovarianceStamped, "~/end_mass/pose")
        self._fix = Output(node, NavSatFix, "~/end_mass/fix")
        self._center = Output(node, PointStamped, "~/orbit_center")
        self._margin = Output(node, Float64, "~/stability_margin")
        self._jump_margin = Output(node, Float64, "~/jump_margin")
        self._cable = Output(node, MarkerArray, "~/cable")
        self._record = Output(node, String, "~/prediction")
        self._datum_fix = Output(node, NavSatFix, "~/datum", latched)
        self._summary = Output(node, String, "~/summary", latched)
        self._of_samples = (
            self._pose, self._fix, self._center, self._margin, self._jump_margin, self._cable,
            self._record,
        )  # fmt: skip

    @property
    def awaited(self) -> bool:
        """Whether anyone subscribes to the pose."""
        return self._pose.awaited

    @property
    def record_awaited(self) -> bool:
        """Whether anyone subscribes to the records."""
        return self._record.awaited

    def have_room(self) -> bool:
        """Whether one more prediction would displace none that is not received yet."""
        return all(output.has_room() for output in self._of_samples)

    def are_received(self) -> bool:
        """Whether every reliable subscriber has received all that was published."""
        everything = (*self._of_samples, self._datum_fix, self._summary)
        return all(output.is_received() for output in everything)

    def publish(self, prediction: Prediction, datum: Datum | None, lifetime: float) -> None:
        """Publish a prediction: the end mass only where it is valid, the centre with an orbit.

        Parameters
        ----------
        prediction : Prediction
        datum : Datum or None
            Of the frame, published whenever it is new.
        lifetime : float
            Seconds until the prediction is stale.
        """
        if prediction.skip is None:
            self._publish_datum(prediction, datum)
            if prediction.orbit is not None:
                self._center.publish(messages.orbit_center(prediction, self._frame_id))
            if prediction.valid:
                self._publish_end_mass(prediction)
            self._show(self._markers(prediction, lifetime))

    def publish_record(self, prediction: Prediction, **extra: float) -> None:
        """Publish the record of a prediction, valid or not, as JSON."""
        record = prediction_record(prediction) | extra
        self._record.publish(String(data=json.dumps(record, allow_nan=False)))

    def publish_summary(self, summary: dict) -> None:
        """Publish the summary of a log, for whoever subscribes now or later."""
        self._summary.publish(String(data=json.dumps(summary, allow_nan=False)))

    def hide(self) -> None:
        """Take away the markers, as what they show is no longer known."""
        self._show([])

    def _publish_end_mass(self, prediction: Prediction) -> None:
        self._pose.publish(messages.end_mass_pose(prediction, self._frame_id))
        fix = messages.end_mass_fix(prediction, self._frame_id)
        if fix is not None:
            self._fix.publish(fix)
        end_mass = prediction.end_mass
        self._margin.publish(Float64(data=end_mass.state.margin_per_s))
        self._jump_margin.publish(Float64(data=end_mass.jump_margin))

    def _publish_datum(self, prediction: Prediction, datum: Datum | None) -> None:
        if datum is not None and datum != self._datum:
            self._datum = datum
            self._datum_fix.publish(messages.datum_fix(datum, prediction, self._frame_id))

    def _markers(self, prediction: Prediction, lifetime: float) -> list[Marker]:
        if not (prediction.valid and self._with_cable and self._cable.awaited):
            return []
        seconds = max(LEAST_LIFETIME, ceil(lifetime))
        return cable_markers(prediction, self._frame_id, seconds)

    def _show(self, markers: list[Marker]) -> None:
        names = {(marker.ns, marker.id) for marker in markers}
        array = MarkerArray(markers=deletions(self._shown - names, self._frame_id) + markers)
        if array.markers:
            self._cable.publish(array)
        self._shown = names
