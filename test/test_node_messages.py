"""Messages to samples and predictions to messages, as functions."""

from dataclasses import replace
from math import cos, hypot, inf, isnan, nan, pi, sin
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2 (rclpy)")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Quaternion, Vector3
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import NavSatFix, NavSatStatus
from visualization_msgs.msg import Marker

from ctcbs_ros.nodes import messages
from ctcbs_ros.nodes.diagnostics import Monitor
from ctcbs_ros.nodes.markers import cable_markers, deletions
from ctcbs_ros.nodes.outputs import Outputs
from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.prediction.codes import Level, Warning, WarningCode
from ctcbs_ros.prediction.prediction import (
    EndMass,
    EndMassState,
    Geodetic,
    Jump,
    Prediction,
)
from ctcbs_ros.prediction.record import prediction_record
from ctcbs_ros.telemetry.skip_code import SkipCode
from ctcbs_ros.telemetry.topics import TopicSamples, velocity_enu

# --- messages to samples ------------------------------------------------------------------------


def odometry(seconds, velocity=(20.0, 0.0, 0.0), quaternion=(0.0, 0.0, 0.0, 1.0)):
    message = Odometry()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(int(seconds * 1e9), 10**9)
    message.pose.pose.position.x = 7.0
    message.pose.pose.orientation = Quaternion(**dict(zip("xyzw", quaternion, strict=True)))
    message.twist.twist.linear = Vector3(**dict(zip("xyz", velocity, strict=True)))
    return message


def fix(seconds, status=NavSatStatus.STATUS_FIX):
    message = NavSatFix(latitude=47.4, longitude=8.5, altitude=500.0)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(int(seconds * 1e9), 10**9)
    message.status.status = status
    return message


def test_twist_in_the_body_frame_is_turned_into_east_north_up():
    rotation = Rotation.from_euler("ZYX", [2.0, 0.1, -0.6])
    body = (21.0, -0.5, 0.3)
    message = odometry(1.0, body, rotation.as_quat())
    assert velocity_enu(message) == pytest.approx(tuple(rotation.apply(body)), abs=1e-12)


def test_quaternion_of_another_length_turns_the_twist_alike():
    rotation = Rotation.from_euler("Z", 0.7)
    message = odometry(1.0, (20.0, 0.0, 0.0), 3.0 * rotation.as_quat())
    assert velocity_enu(message) == pytest.approx((20 * cos(0.7), 20 * sin(0.7), 0.0))


def test_odometry_without_orientation_has_no_velocity():
    assert velocity_enu(odometry(1.0, quaternion=(0.0, 0.0, 0.0, 0.0))) is None
    assert velocity_enu(odometry(1.0, quaternion=(nan, 0.0, 0.0, 1.0))) is None


def test_samples_are_timed_by_the_header_stamp():
    samples = TopicSamples()
    first, second = samples.fix(fix(1000.25)), samples.fix(fix(1000.75))
    assert second.time - first.time == pytest.approx(0.5, abs=1e-6)
    assert first.stamp_ns == 1_000_250_000_000


def test_fix_alone_gives_position_without_velocity():
    sample = TopicSamples().fix(fix(5.0))
    assert (sample.latitude, sample.longitude, sample.altitude_ellipsoid) == (47.4, 8.5, 500.0)
    assert sample.velocity is None
    assert isnan(sample.altitude_amsl)


def test_fix_takes_its_velocity_from_the_odometry_of_the_same_time():
    samples = TopicSamples()
    samples.odometry(odometry(5.0))
    assert samples.fix(fix(5.05)).velocity == pytest.approx((20.0, 0.0, 0.0))
    assert samples.fix(fix(5.2)).velocity is None


def test_odometry_gives_samples_until_a_fix_is_heard_which_begins_a_new_flight():
    samples = TopicSamples()
    local = samples.odometry(odometry(5.0))
    assert local.local_position == (7.0, 0.0, 0.0)
    geodetic = samples.fix(fix(5.1))
    assert geodetic.flight != local.flight
    assert samples.odometry(odometry(5.2)) is None


def test_fix_without_status_fix_is_evidence_against_it():
    assert TopicSamples().fix(fix(1.0, NavSatStatus.STATUS_NO_FIX)).fix_type < 3
    assert TopicSamples().fix(fix(1.0)).fix_type == 3
    unknown = -2  # NavSatStatus.STATUS_UNKNOWN, the default since Jazzy
    assert TopicSamples().fix(fix(1.0, unknown)).fix_type is None


def test_accuracy_is_the_larger_deviation_and_unknown_where_not_stated():
    message = fix(1.0)
    message.position_covariance[0], message.position_covariance[4] = 4.0, 9.0
    assert isnan(TopicSamples().fix(message).horizontal_accuracy)
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    assert TopicSamples().fix(message).horizontal_accuracy == pytest.approx(3.0)


def test_stamps_that_begin_again_begin_a_new_flight_in_continuous_time():
    samples = TopicSamples()
    before, after = samples.fix(fix(5000.0)), samples.fix(fix(100.0))
    assert after.flight == before.flight + 1
    assert after.time > before.time


# --- predictions to messages --------------------------------------------------------------------

STAMP = 1_767_268_800_123_456_789


def state(radius=10.0, depth=100.0):
    return EndMassState(radius, depth, 1.0, 4.0, 5.0, 6.0, 0.3, 0.1, 0.2, True, 1e-12)


def prediction(**changes):
    """A valid prediction by hand: orbit about (1, 2, 300), end mass north of the centre."""
    covariance = np.diag([1.0, 2.0, 3.0, 1e6, 1e6, 0.01])
    orbit = Orbit(
        time=9.0, start_time=1.0, center=np.array([1.0, 2.0, 300.0]), radius=60.0,
        angular_rate=1 / 3, sense=-1, phase=0.5, climb_rate=0.0, rms_residual=0.1, arc=5.0,
        samples=40, covariance=np.eye(6),
    )  # fmt: skip
    end_mass = EndMass(
        state=state(), branch="main", position=np.array([1.0, 12.0, 200.0]), yaw=0.0,
        covariance=covariance, fold_distance=4.0, geodetic=Geodetic(47.4, 8.5, 650.0, True),
        height_above_home=150.0, circle_center=np.array([1.0, 2.0, 200.0]),
        cable=np.linspace([1.0, 12.0, 200.0], [50.0, 30.0, 300.0], 41), settling_time=30.0,
        time_on_orbit=40.0, sense=-1,
        nearest_loss="flutter", others=(), jump_in_angular_rate=None, jump_in_speed=None,
        jump_in_radius=None, method="full solve",
    )  # fmt: skip
    changes = {"end_mass": end_mass, "orbit": orbit, "warnings": ()} | changes
    return Prediction(
        time=9.0, stamp_ns=STAMP, flight=0, skip=None, tow_point=np.zeros(3), air_density=1.2,
        **changes,
    )  # fmt: skip


def with_end_mass(**changes):
    return prediction(end_mass=replace(prediction().end_mass, **changes))


def skipped(code):
    return Prediction(9.0, STAMP, 0, code, None, None, None, nan, ())


def test_pose_has_the_stamp_of_the_sample_and_x_along_the_motion():
    for yaw in (-2.5, 0.0, 1.2, pi):
        message = messages.end_mass_pose(with_end_mass(yaw=yaw), "map")
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(STAMP, 10**9)
        assert message.header.frame_id == "map"
        q = message.pose.pose.orientation
        forward = Rotation.from_quat([q.x, q.y, q.z, q.w]).apply([1.0, 0.0, 0.0])
        assert forward == pytest.approx([cos(yaw), sin(yaw), 0.0], abs=1e-12)
        position = message.pose.pose.position
        assert (position.x, position.y, position.z) == (1.0, 12.0, 200.0)


def test_covariances_of_the_attitude_that_is_not_known_are_large():
    covariance = messages.end_mass_pose(prediction(), "map").pose.covariance.reshape(6, 6)
    assert (np.diag(covariance)[3:5] >= 1e6).all()
    np.testing.assert_array_equal(np.diag(covariance)[:3], [1.0, 2.0, 3.0])


def test_fix_has_latitude_longitude_altitude_and_the_covariance_of_the_position():
    message = messages.end_mass_fix(prediction(), "map")
    assert (message.latitude, message.longitude, message.altitude) == (47.4, 8.5, 650.0)
    np.testing.assert_array_equal(
        message.position_covariance.reshape(3, 3), np.diag([1.0, 2.0, 3.0])
    )


def test_without_datum_there_is_no_fix():
    unknown = with_end_mass(geodetic=Geodetic(nan, nan, nan, False))
    assert messages.end_mass_fix(unknown, "map") is None


def test_markers_draw_the_cable_and_circles_of_each_solution():
    found = cable_markers(with_end_mass(others=(state(30.0, 90.0), state(50.0, 70.0))), "map", 5)
    by_name = {(marker.ns, marker.id): marker for marker in found}
    assert set(by_name) == {
        ("cable", 0), ("tow_circle", 0), ("end_mass_circle", 0),
        ("other_solutions", 0), ("other_solutions", 1),
    }  # fmt: skip
    assert all(marker.type == Marker.LINE_STRIP for marker in found)
    assert all(marker.lifetime.sec == 5 for marker in found)
    assert len(by_name["cable", 0].points) == 41
    for name, radius, height in (
        (("tow_circle", 0), 60.0, 300.0),
        (("end_mass_circle", 0), 10.0, 200.0),
        (("other_solutions", 1), 50.0, 230.0),
    ):
        for point in by_name[name].points:
            assert hypot(point.x - 1.0, point.y - 2.0) == pytest.approx(radius)
            assert point.z == height


class Published:
    """In place of a node: what its publishers publish, by topic."""

    def __init__(self):
        self.messages = {}

    def create_publisher(self, message_type, topic, qos):
        kept = self.messages[topic.partition("/")[2]] = []
        return SimpleNamespace(publish=kept.append, get_subscription_count=lambda: 1)


def test_no_pose_fix_or_marker_without_the_motion_in_the_wind_but_the_record_and_margins():
    published = Published()
    outputs = Outputs(published, "map", with_cable=True, complete=False)
    windy = with_end_mass(unmodelled_because="none found")
    outputs.publish(windy, None, 1.0)
    outputs.publish_record(windy)
    where = {"end_mass/pose", "end_mass/fix", "cable"}
    given = {topic for topic, messages in published.messages.items() if messages}
    assert given == {"orbit_center", "stability_margin", "jump_margin", "prediction"}
    outputs.publish(prediction(), None, 1.0)
    assert where <= {topic for topic, messages in published.messages.items() if messages}
    # What was shown is taken away.
    outputs.publish(windy, None, 1.0)
    assert {m.action for m in published.messages["cable"][-1].markers} == {Marker.DELETE}
    assert len(published.messages["end_mass/pose"]) == 1


@pytest.mark.parametrize("how", ["no longer valid", "silence"])
def test_margins_end_with_one_nan_when_they_are_no_longer_known(how):
    published = Published()
    outputs = Outputs(published, "map", with_cable=False, complete=False)
    lost = prediction(orbit=None, end_mass=None)

    def end():
        if how == "silence":
            outputs.hide()
        else:
            outputs.publish(lost, None, 1.0)

    margins = [published.messages[name] for name in ("stability_margin", "jump_margin")]
    end()
    assert margins == [[], []]
    outputs.publish(prediction(), None, 1.0)
    end()
    end()
    outputs.publish(prediction(), None, 1.0)
    for published_margins in margins:
        assert [isnan(message.data) for message in published_margins] == [False, True, False]


def test_deletions_name_each_marker_to_take_away():
    gone = deletions({("cable", 0), ("other_solutions", 1)}, "map")
    assert [(m.ns, m.id, m.action) for m in gone] == [
        ("cable", 0, Marker.DELETE), ("other_solutions", 1, Marker.DELETE),
    ]  # fmt: skip


# --- diagnostics --------------------------------------------------------------------------------


def values(status):
    return {pair.key: pair.value for pair in status.values}


def warned(code, level):
    return (Warning(code, level, f"about {code.value}"),)


def test_diagnostics_hold_every_figure_of_the_record():
    monitor = Monitor()
    jump = Jump(0.4, 0.2, 33.0)
    shown = with_end_mass(others=(state(30.0),), jump_in_angular_rate=jump)
    monitor.add(shown)
    _, orbit, found = monitor.report(None, {})
    keys = set(values(orbit)) | set(values(found))
    record = prediction_record(shown)
    others = record.pop("other_solutions")
    record.pop("warnings")
    of_sample = {"vehicle_time_s", "stamp_ns", "flight", "skip", "valid"} | {
        f"tow_point_{axis}_m" for axis in ("east", "north", "up")
    }
    assert set(record) - of_sample <= keys
    assert {f"other_solutions[0].{key}" for key in others[0]} <= keys
    assert float(values(found)["end_mass_radius_m"]) == 10.0
    assert float(values(found)["jump_margin"]) == 0.2


@pytest.mark.parametrize(
    ("code", "level", "where"),
    [
        (WarningCode.BAD_FIX, Level.WARN, 0),
        (WarningCode.STALE_TELEMETRY, Level.ERROR, 0),
        (WarningCode.OUTSIDE_ENVELOPE, Level.WARN, 1),
        (WarningCode.WIND_UNMODELLED, Level.WARN, 2),
        (WarningCode.NEAR_JUMP, Level.WARN, 2),
        (WarningCode.GROUND_PROXIMITY, Level.ERROR, 2),
        (WarningCode.UNSTABLE, Level.ERROR, 2),
    ],
)
def test_warning_sets_the_level_and_the_message_of_its_subject(code, level, where):
    monitor = Monitor()
    monitor.add(prediction(warnings=warned(code, level)))
    statuses = monitor.report(None, {})
    ros_level = {Level.WARN: DiagnosticStatus.WARN, Level.ERROR: DiagnosticStatus.ERROR}[level]
    for number, status in enumerate(statuses):
        assert status.level == (ros_level if number == where else DiagnosticStatus.OK)
    assert statuses[where].message == f"{code.value}: about {code.value}"
    assert values(statuses[where])[f"warning {code.value}"] == f"about {code.value}"


def test_every_skip_is_counted_and_the_orbit_stands_through_it():
    monitor = Monitor()
    monitor.add(prediction())
    for code in SkipCode:
        monitor.add(skipped(code))
    telemetry, orbit, found = monitor.report(None, {})
    assert all(values(telemetry)[f"skipped {code.value}"] == "1" for code in SkipCode)
    assert values(telemetry)["samples"] == str(1 + len(SkipCode))
    assert (orbit.message, found.message) == ("orbiting", "valid, settled")


def test_silence_is_an_error_and_takes_orbit_and_prediction_away():
    monitor = Monitor()
    monitor.add(prediction())
    silence = Warning(WarningCode.STALE_TELEMETRY, Level.ERROR, "no position for 3 s")
    for status in monitor.report(silence, {}):
        assert status.level == DiagnosticStatus.ERROR
        assert "end_mass_radius_m" not in values(status)


def test_without_orbit_there_is_a_warning_and_no_end_mass():
    monitor = Monitor()
    straight = warned(WarningCode.NOT_ORBITING, Level.WARN)
    monitor.add(prediction(orbit=None, end_mass=None, warnings=straight))
    _, orbit, found = monitor.report(None, {})
    assert orbit.level == found.level == DiagnosticStatus.WARN
    assert orbit.message.startswith("NOT_ORBITING")
    assert not found.values


def test_an_end_mass_on_its_way_is_said_to_be_settling():
    for changed, told in (
        ({"time_on_orbit": 12.0}, "valid, still settling: 12 s on this orbit of 30 s"),
        ({"settling_time": inf}, "valid, but nothing settles: 40 s on this orbit"),
    ):
        monitor = Monitor()
        monitor.add(with_end_mass(**changed))
        assert monitor.report(None, {})[2].message == told
        low = Warning(WarningCode.LOW_MARGIN, Level.WARN, "slow")
        monitor.add(replace(with_end_mass(**changed), warnings=(low,)))
        assert monitor.report(None, {})[2].message == f"LOW_MARGIN: slow; {told}"


def test_infinite_settling_time_is_shown_as_none():
    monitor = Monitor()
    monitor.add(with_end_mass(settling_time=inf))
    assert values(monitor.report(None, {})[2])["settling_time_s"] == "none"


def test_unknown_height_above_ground_is_said_so_that_silence_is_not_taken_for_safety():
    for height, judged in ((150.0, True), (nan, False)):
        monitor = Monitor()
        monitor.add(with_end_mass(height_above_home=height))
        values = {v.key: v.value for v in monitor.report(None, {})[2].values}
        assert (values["ground proximity"] == "judged") is judged


def test_without_the_motion_in_the_wind_the_ground_is_said_not_to_be_judged():
    monitor = Monitor()
    monitor.add(with_end_mass(unmodelled_because="none found"))
    report = monitor.report(None, {})[2]
    figures = {v.key: v.value for v in report.values}
    assert figures["ground proximity"] == "not judged: the wind is not modelled"
    assert figures["end_mass_lowest_above_home_m"] == "none"
    assert figures["settled"] == figures["pose_holds"] == "false"
    assert report.message == "valid for still air only, no pose"
