"""The topics that the node publishes."""

import json
from collections import deque
from math import ceil, nan

from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped, Vector3Stamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile
from sensor_msgs.msg import NavSatFix
from std_msgs.msg import Float64, String
from visualization_msgs.msg import Marker, MarkerArray

from ctcbs_ros.beacon.comparison import Comparison
from ctcbs_ros.beacon.record import comparison_record
from ctcbs_ros.geodesy import Datum
from ctcbs_ros.nodes import messages
from ctcbs_ros.nodes.markers import Name, cable_markers, deletions
from ctcbs_ros.prediction.prediction import Prediction
from ctcbs_ros.prediction.record import prediction_record

# Of a live flight the newest predictions count, and of a log all: then publishing fails as long as
# a reliable subscriber has not received what DDS can hold.
LIVE = QoSProfile(depth=10)
COMPLETE = QoSProfile(history=QoSHistoryPolicy.KEEP_ALL)
LATCHED = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
ACKNOWLEDGEMENT = Duration(nanoseconds=10_000_000)  # waited for at a time
LEAST_LIFETIME = 5  # s, of a marker


class Output:
    """One reliable topic."""

    def __init__(self, node: Node, message_type: type, topic: str, qos: QoSProfile):
        self._publisher = node.create_publisher(message_type, topic, qos)
        self._complete = qos.history == QoSHistoryPolicy.KEEP_ALL
        self._waiting: deque = deque()

    @property
    def awaited(self) -> bool:
        """Whether anyone subscribes."""
        return self._publisher.get_subscription_count() > 0

    def publish(self, message) -> None:
        """Publish a message, or keep it for `flush` where there is no room for it yet."""
        self._waiting.append(message)
        self.flush()

    def flush(self) -> bool:
        """Publish what has been kept; whether all of it is published now."""
        while self._waiting:
            try:
                self._publisher.publish(self._waiting[0])
            except RuntimeError:
                if not self._complete:
                    raise
                return False
            self._waiting.popleft()
        return True

    def is_received(self) -> bool:
        """Whether every subscriber has received everything; waits a little for it."""
        return self.flush() and self._publisher.wait_for_all_acked(ACKNOWLEDGEMENT)


class Outputs:
    """Publishers of the predictions.

    Parameters
    ----------
    node : Node
    frame_id : str
        Frame of what is published.
    with_cable : bool
        Whether markers are published.
    complete : bool
        Whether every prediction is to be received by every reliable subscriber, however slow.
    with_beacon : bool
        Whether the payload has a beacon.
    """

    def __init__(
        self, node: Node, frame_id: str, with_cable: bool, complete: bool,
        with_beacon: bool = False,
    ):  # fmt: skip
        self._frame_id = frame_id
        self._with_cable = with_cable
        self._shown: set[Name] = set()  # markers that stand
        self._margins_stand = False
        self._datum: Datum | None = None

        qos = COMPLETE if complete else LIVE
        self._pose = Output(node, PoseWithCovarianceStamped, "~/end_mass/pose", qos)
        self._simulated = Output(
            node, PoseWithCovarianceStamped, "~/end_mass/simulated_pose", qos
        )
        self._fix = Output(node, NavSatFix, "~/end_mass/fix", qos)
        self._center = Output(node, PointStamped, "~/orbit_center", qos)
        self._margin = Output(node, Float64, "~/stability_margin", qos)
        self._jump_margin = Output(node, Float64, "~/jump_margin", qos)
        self._cable = Output(node, MarkerArray, "~/cable", qos)
        self._record = Output(node, String, "~/prediction", qos)
        self._datum_fix = Output(node, NavSatFix, "~/datum", LATCHED)
        self._summary = Output(node, String, "~/summary", LATCHED)
        self._all = (
            self._pose, self._simulated, self._fix, self._center, self._margin,
            self._jump_margin, self._cable, self._record, self._datum_fix, self._summary,
        )  # fmt: skip
        if with_beacon:
            what = "~/end_mass/measured_minus_"
            self._off_prediction = Output(node, Vector3Stamped, f"{what}predicted", qos)
            self._off_simulation = Output(node, Vector3Stamped, f"{what}simulated", qos)
            self._comparison = Output(node, String, "~/beacon", qos)
            self._all += (self._off_prediction, self._off_simulation, self._comparison)

    @property
    def awaited(self) -> bool:
        """Whether anyone subscribes to the pose."""
        return self._pose.awaited

    @property
    def record_awaited(self) -> bool:
        """Whether anyone subscribes to the records."""
        return self._record.awaited

    def flush(self) -> bool:
        """Publish what has been kept for want of room; whether all of it is published now."""
        return all(output.flush() for output in self._all)

    def are_received(self) -> bool:
        """Whether every reliable subscriber has received all that was published."""
        return all(output.is_received() for output in self._all)

    def publish(self, prediction: Prediction, datum: Datum | None, lifetime: float) -> None:
        """Publish a prediction: the end mass only where its pose holds, the margins where it is
        valid, the simulated one where that is, the centre with an orbit.

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
            if prediction.pose_holds:
                self._publish_end_mass(prediction)
            if prediction.valid:
                self._publish_margins(prediction)
            else:
                self._end_margins()
            if prediction.simulated is not None and prediction.simulated.valid:
                self._simulated.publish(messages.simulated_pose(prediction, self._frame_id))
            self._show(self._markers(prediction, lifetime))

    def publish_record(self, prediction: Prediction, **extra: float) -> None:
        """Publish the record of a prediction, valid or not, as JSON."""
        record = prediction_record(prediction) | extra
        self._record.publish(String(data=json.dumps(record, allow_nan=False)))

    def publish_comparison(self, comparison: Comparison) -> None:
        """Publish what a report of the beacon came to: differences only where they are errors."""
        for found, output in (
            (comparison.predicted if comparison.settled else None, self._off_prediction),
            (
                comparison.simulated if comparison.simulated_settled else None,
                self._off_simulation,
            ),
        ):
            if found is not None:
                output.publish(
                    messages.difference(found, comparison.stamp_ns, self._frame_id)
                )
        record = comparison_record(comparison)
        self._comparison.publish(String(data=json.dumps(record, allow_nan=False)))

    def publish_summary(self, summary: dict) -> None:
        """Publish the summary of a log, for whoever subscribes now or later."""
        self._summary.publish(String(data=json.dumps(summary, allow_nan=False)))

    def hide(self) -> None:
        """Take away markers and margins, as what they show is no longer known."""
        self._show([])
        self._end_margins()

    def _publish_end_mass(self, prediction: Prediction) -> None:
        self._pose.publish(messages.end_mass_pose(prediction, self._frame_id))
        fix = messages.end_mass_fix(prediction, self._frame_id)
        if fix is not None:
            self._fix.publish(fix)

    def _publish_margins(self, prediction: Prediction) -> None:
        end_mass = prediction.end_mass
        self._margin.publish(Float64(data=end_mass.margin.per_second))
        self._jump_margin.publish(Float64(data=end_mass.jump_margin))
        self._margins_stand = True

    def _end_margins(self) -> None:
        # A display shows the last value for as long as no other comes.
        if self._margins_stand:
            self._margin.publish(Float64(data=nan))
            self._jump_margin.publish(Float64(data=nan))
            self._margins_stand = False

    def _publish_datum(self, prediction: Prediction, datum: Datum | None) -> None:
        if datum is not None and datum != self._datum:
            self._datum = datum
            self._datum_fix.publish(messages.datum_fix(datum, prediction, self._frame_id))

    def _markers(self, prediction: Prediction, lifetime: float) -> list[Marker]:
        if not (prediction.pose_holds and self._with_cable and self._cable.awaited):
            return []
        seconds = max(LEAST_LIFETIME, ceil(lifetime))
        return cable_markers(prediction, self._frame_id, seconds)

    def _show(self, markers: list[Marker]) -> None:
        names = {(marker.ns, marker.id) for marker in markers}
        array = MarkerArray(markers=deletions(self._shown - names, self._frame_id) + markers)
        if array.markers:
            self._cable.publish(array)
        self._shown = names
