"""The node: parameters in, samples from a log, a link or topics, predictions out."""

import re
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped, TwistWithCovarianceStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import NavSatFix

from ctcbs_ros.configuration import Configuration, configuration_from_mapping
from ctcbs_ros.errors import InputError
from ctcbs_ros.nodes.beacon import NodeBeacon
from ctcbs_ros.nodes.diagnostics import Monitor
from ctcbs_ros.nodes.journal import Journal
from ctcbs_ros.nodes.log_pump import LogPump
from ctcbs_ros.nodes.outputs import Outputs
from ctcbs_ros.nodes.parameters import declare_parameters
from ctcbs_ros.orbit.segments import LEAST_TURNS
from ctcbs_ros.prediction.codes import Level, Warning, WarningCode
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.prediction.record import Record, altitude_reference
from ctcbs_ros.prediction.warm_up import spare_collector, warm_up
from ctcbs_ros.replay.summary import Summary, beacon_counts, beacon_link, source_counts
from ctcbs_ros.schema import BY_KEY, why_unknown
from ctcbs_ros.table import table_for
from ctcbs_ros.telemetry.beacon import BeaconSample, BeaconWanted, beacon_wanted
from ctcbs_ros.telemetry.link import Vehicle
from ctcbs_ros.telemetry.live import LiveSource
from ctcbs_ros.telemetry.mavlink import open_link
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.telemetry.source import LogSource, open_log
from ctcbs_ros.telemetry.topics import TopicSamples
from ctcbs_ros.telemetry.transport import ALLOWED, SCHEMES

# Topics in, as mavros publishes them; remapped where others do.
FIX, ODOM = "mavros/global_position/global", "mavros/local_position/odom"
POSE, VELOCITY = "mavros/local_position/pose", "mavros/local_position/velocity_local"
WIND = "mavros/wind_estimation"
POLL_PERIOD = 0.02  # s between two looks at a live link
POLL_TIME = 0.05  # s that one of them may take
LINKS = (*(f"{scheme}:" for scheme in SCHEMES), "/dev/")


class PredictorNode(Node):
    """The `predictor` node.

    Attributes
    ----------
    finished : bool
        Whether the node's log has been replayed and replay.exit_at_end is set.

    Raises
    ------
    InputError
        If a parameter is refused, the log or link cannot be opened, or the table does not fit.
    """

    def __init__(self):
        super().__init__("predictor", automatically_declare_parameters_from_overrides=True)
        self._values: dict[str, Any] = declare_parameters(self)
        configuration = self._configuration(self._values)
        self.finished = False
        self._monitor = Monitor()
        self._journal = Journal(self.get_logger())
        self._last_sample_at = None
        self._log: LogSource | None = None
        self._log_summary: Summary | None = None
        self._live: LiveSource | None = None
        self._vehicle: Vehicle | None = None
        self._beacon_vehicle: Vehicle | None = None
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)

        url = self._values["mavlink.url"]
        topics = (self.resolve_topic_name(name) for name in (FIX, ODOM, POSE))
        self._source_name = url or f"topics {', '.join(topics)}"
        if _names_log(url):
            self._log = open_log(url, *self._vehicle_wanted(), self._beacon_wanted(url))
        elif url:
            self._live = open_link(
                url,
                self._values["mavlink.baud"],
                *self._vehicle_wanted(),
                heartbeat=self._values["mavlink.heartbeat"],
                request_rate=self._values["mavlink.request_rate"],
                beacon=self._beacon_wanted(url),
            )
        else:
            self._refuse_beacon_of_topics()

        self.get_logger().info("loading the table, or building it where there is none yet")
        table = table_for(configuration, self._values["table.file"], sys.stderr.isatty())
        with_twin = self._values["twin.enabled"]
        warm_up(configuration, table, with_twin)
        self._predictor = Predictor(configuration, table, with_twin)
        self._outputs = Outputs(
            self,
            self._values["frame_id"],
            with_cable=self._values["publish_cable"],
            complete=self._log is not None,
            with_beacon=configuration.beacon.present,
        )
        self._beacon: NodeBeacon | None = None
        if configuration.beacon.present:
            self._beacon = NodeBeacon(configuration, self._predictor, self._outputs)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.add_on_set_parameters_callback(self._check_change)
        self.add_post_set_parameters_callback(self._change)
        self.create_timer(self._values["diagnostics.period"], self._diagnose, clock=self._steady)
        self._listen()
        spare_collector()
        self.get_logger().info(f"ready, telemetry from {self._source_name}")

    def close(self) -> None:
        """Give up the link."""
        if self._live is not None:
            self._live.close()

    # --- telemetry in, predictions out ----------------------------------------------------------

    def _listen(self) -> None:
        if self._log is not None:
            self._log_summary = Summary(self._predictor)
            self._name_vehicle()
            self._pump = LogPump(
                self,
                self._log,
                self._outputs,
                rate=self._values["replay.rate"],
                wait=self._values["replay.wait_for_subscribers"],
                take=self._take,
                at_end=self._end_log,
                when_received=self._finish,
            )
        elif self._live is not None:
            self.create_timer(POLL_PERIOD, self._poll, clock=self._steady)
        else:
            self._subscribe(TopicSamples())
        topic = self._values["beacon.topic"]
        if topic and self._log is None:
            self.create_subscription(
                NavSatFix, topic, self._take_beacon_fix, qos_profile_sensor_data
            )

    def _take_beacon_fix(self, message: NavSatFix) -> None:
        self._beacon.take_fix(message, self.get_clock().now().nanoseconds / 1e9)

    def _subscribe(self, samples: TopicSamples) -> None:
        def hear(handler, message) -> None:
            self._take(handler(message, self.get_clock().now().nanoseconds // 1000))

        for name, message_type, handler in (
            (FIX, NavSatFix, samples.fix),
            (ODOM, Odometry, samples.odometry),
            (POSE, PoseStamped, samples.pose),
            (VELOCITY, TwistStamped, samples.twist),
            (WIND, TwistWithCovarianceStamped, samples.wind_estimation),
        ):
            self.create_subscription(
                message_type, name, partial(hear, handler), qos_profile_sensor_data
            )

    def _poll(self) -> None:
        self._name_vehicle()
        self._journal.link(self._live.state())
        if self._vehicle is not None:
            others = list(self._live.link.positions_of_others)
            self._journal.others(others, self._vehicle.system, self._beacon is not None)
        until = time.monotonic() + POLL_TIME
        while (sample := self._live.take()) is not None:
            self._take(sample)
            if time.monotonic() > until:
                return  # what waits gives way to newer samples, and the node answers meanwhile

    def _name_vehicle(self) -> None:
        vehicle = (self._log or self._live).vehicle
        if vehicle != self._vehicle:
            self._vehicle = vehicle
            self.get_logger().info(
                f"following {vehicle.type}, system {vehicle.system}, component {vehicle.component}"
            )
        beacon = (self._log or self._live).beacon
        if beacon is not None and self._beacon_vehicle is None:
            self._beacon_vehicle = beacon
            self.get_logger().info(
                f"beacon: system {beacon.system}, component {beacon.component}"
            )

    def _take(self, sample: Sample | BeaconSample | None) -> None:
        if sample is None:
            return
        if isinstance(sample, BeaconSample):
            self._beacon.take(sample)
            return
        self._last_sample_at = self.get_clock().now()
        prediction = self._predictor.update(sample)
        self._monitor.add(prediction)
        self._journal.add(prediction)
        self._outputs.publish(
            prediction, self._predictor.datum, self._values["limits.stale_after"]
        )
        if self._log is not None:
            self._log_summary.add(prediction)
            self._outputs.publish_record(prediction, log_progress=self._log.progress)
        elif self._outputs.record_awaited:
            self._outputs.publish_record(prediction)
        if self._beacon is not None:
            received = self._last_sample_at.nanoseconds / 1e9
            self._beacon.hear(sample, received, prediction)

    def _end_log(self) -> None:
        if self._beacon is not None:
            self._beacon.finish()
        self._diagnose()
        tally = self._beacon and self._beacon.tally
        summary = self._log_summary.finish() | source_counts(self._log)
        summary |= beacon_counts(self._log, tally)
        self._outputs.publish_summary(summary)
        self.get_logger().info(
            f"end of the log: {summary['predictions']} predictions from "
            f"{summary['samples']} samples; orbits of {LEAST_TURNS:g} turns or more: "
            f"{len(summary['orbits'])}"
        )

    def _finish(self) -> None:
        if self._values["replay.exit_at_end"]:
            self.finished = True

    # --- diagnostics ----------------------------------------------------------------------------

    def _diagnose(self) -> None:
        silence = self._silence()
        if silence is not None:
            self._outputs.hide()
        self._warn_of_lateness()
        array = DiagnosticArray()
        array.header.stamp = self.get_clock().now().to_msg()
        array.status = self._monitor.report(silence, self._source_figures())
        if self._beacon is not None:
            stale_after = self._values["limits.stale_after"] if self._log is None else None
            array.status.append(self._beacon.status(stale_after, self._beacon_figures()))
        for status in array.status:
            status.name = f"{self.get_name()}: {status.name}"
            status.hardware_id = self._source_name
        self._diagnostics.publish(array)

    def _warn_of_lateness(self) -> None:
        limit = self._values["limits.stale_after"]
        if self._live is not None and self._live.late > limit:
            text = f"positions arrive {self._live.late:.1f} s late (limit {limit:g} s)"
            self._monitor.warn(Warning(WarningCode.STALE_TELEMETRY, Level.WARN, text))

    def _silence(self) -> Warning | None:
        """The warning that no sample comes, by the node's clock; a log is silent only at first."""
        if self._last_sample_at is None:
            warning = Warning(WarningCode.STALE_TELEMETRY, Level.ERROR, "no sample yet")
        elif self._log is not None:
            return None
        else:
            since = self.get_clock().now() - self._last_sample_at
            warning = self._predictor.stale(since.nanoseconds / 1e9)
        if self._live is None or self._last_sample_at is not None:
            self._journal.silence(warning)
        if warning is not None and self._live is not None:
            link = self._live.state().partition(" for ")[0]  # the warning says for how long
            return replace(warning, text=f"{warning.text}; link {link}")
        return warning

    def _source_figures(self) -> Record:
        figures: Record = {"source": self._source_name}
        if self._last_sample_at is not None:
            since = self.get_clock().now() - self._last_sample_at
            figures["seconds since sample"] = since.nanoseconds / 1e9
        datum = self._predictor.datum
        if datum is not None:
            figures["altitude of ~/end_mass/fix and ~/datum is above"] = altitude_reference(
                datum.ellipsoidal
            )
        source = self._log or self._live
        if source is not None:
            figures |= source_counts(source)
        if self._log is not None:
            figures["log progress"] = self._log.progress
        if self._live is not None:
            figures["link state"] = self._live.state()
            figures["seconds sample came late"] = self._live.late
            figures["link connections"] = self._live.connections
            figures["reads not decoded"] = self._live.failures
            figures["dropped because the node was late"] = self._live.dropped
            figures["datagrams dropped by the system"] = self._live.datagrams_dropped
            figures |= {f"rate of {name}": told for name, told in self._live.answers.items()}
        return figures

    def _beacon_figures(self) -> Record:
        source = self._log or self._live
        if source is None or source.beacon_link is None:
            return {"source": self.resolve_topic_name(self._values["beacon.topic"])}
        figures: Record = {"source": f"system {self._values['beacon.system_id']}"}
        if self._live is not None:
            figures["dropped because the node was late"] = self._live.reports_dropped
        return figures | beacon_link(source)

    # --- parameters -----------------------------------------------------------------------------

    def _configuration(self, values: dict[str, Any]) -> Configuration:
        return configuration_from_mapping(
            values, f"parameters of {self.get_fully_qualified_name()}"
        )

    def _vehicle_wanted(self) -> tuple[int | None, int | None]:
        return self._values["mavlink.system"] or None, self._values["mavlink.component"] or None

    def _beacon_wanted(self, url: str) -> BeaconWanted | None:
        """Whom to part from the aircraft on a link or in a log; a topic is none of a link's."""
        names = ("beacon.system_id", "beacon.component_id", "beacon.topic")
        system, component, topic = (self._values[name] for name in names)
        return beacon_wanted(system, component, topic if _names_log(url) else "")

    def _refuse_beacon_of_topics(self) -> None:
        """Refuse a beacon that topics cannot have."""
        source = f"parameters of {self.get_fully_qualified_name()}"
        system, topic = self._values["beacon.system_id"], self._values["beacon.topic"]
        if system:
            raise InputError(
                f"{source}: beacon.system_id = {system}: only with a MAVLink link or log in "
                "mavlink.url; use beacon.topic"
            )
        if topic and self.resolve_topic_name(topic) == self.resolve_topic_name(FIX):
            raise InputError(
                f"{source}: beacon.topic = {topic!r}: is the tow aircraft's position"
            )

    def _changed(self, parameters: list[Parameter]) -> dict[str, Any]:
        return self._values | {p.name: p.value for p in parameters if p.name in BY_KEY}

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters as ROS does; a refusal says what is allowed, and is logged."""
        before = self._values
        result = self._refused(parameter_list) or super().set_parameters_atomically(parameter_list)
        if not result.successful:
            self.get_logger().warning(f"change refused: {result.reason}")
        for name in {parameter.name for parameter in parameter_list} & set(BY_KEY):
            value = self._values[name]
            if result.successful and value != before[name]:
                self.get_logger().info(f"{name} changed from {before[name]} to {value}")
        return result

    def _refused(self, parameters: list[Parameter]) -> SetParametersResult | None:
        """What the table of parameters refuses, in better words than ROS's own."""
        source = f"parameters of {self.get_fully_qualified_name()}"
        reason = ""
        for parameter in parameters:
            spec, name = BY_KEY.get(parameter.name), parameter.name
            if spec is None and not self.has_parameter(name):
                reason = f"{source}: {name}: {why_unknown(name)}"
            elif spec is not None and not spec.runtime:
                reason = f"{source}: {name} is read-only: set it and start the node again"
            elif spec is not None:
                try:
                    spec.check(parameter.value, source)
                except InputError as error:
                    reason = str(error)
        return SetParametersResult(successful=False, reason=reason) if reason else None

    def _check_change(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._configuration(self._changed(parameters))
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _change(self, parameters: list[Parameter]) -> None:
        self._values = self._changed(parameters)
        configuration = self._configuration(self._values)
        self._predictor.change(
            cable_length=configuration.cable.length,
            end_mass=configuration.end_mass.mass,
            limits=configuration.limits,
        )
        if self._beacon is not None:
            self._beacon.change(configuration.cable.length)


def _names_log(url: str) -> bool:
    """Whether a url is the path of a log rather than a link or nothing."""
    if url == "" or url.startswith(LINKS) or Path(url).is_char_device():
        return False
    if re.match(r"[a-z][a-z0-9+.-]+:", url, re.IGNORECASE) and not Path(url).exists():
        raise InputError(f"mavlink.url = {url!r}: no such link or log; {ALLOWED}, or a log's path")
    return True
