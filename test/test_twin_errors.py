"""What the twin states of its errors: true places inside its regions from its first value on."""

import numpy as np
import pytest

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.dynamics.cable import CableState, drive, simulate
from ctcbs_ros.dynamics.equilibrium import trailing
from ctcbs_ros.dynamics.signal import constant, spline
from ctcbs_ros.geodesy import Datum, to_enu, to_geodetic
from ctcbs_ros.orbit.coverage import in_region
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.scaling import flight_point
from ctcbs_ros.simulated_flight import simulate_flight
from ctcbs_ros.telemetry.sample import Sample
from ctcbs_ros.twin.followed import off_winds
from ctcbs_ros.twin.simulated import TwinState
from ctcbs_ros.twin.simulated_cable import line_in_si

DRONE = load_configuration("small_drone")
RADIUS, SPEED = 60.0, 18.0
SIGMA, OF_WIND = 1.5, 0.4  # of a position [m] and of the wind told [m/s], along an axis


def true_places(flight, air):
    """Of a finer cable in one run along the true path; the log may begin later."""
    length = DRONE.cable.length
    line = line_in_si(flight_point(DRONE, length, SPEED, 1.225))
    begun = trailing(line, 30, flight.position[0], flight.velocity[0], (*air, 0.0))
    begun = CableState(float(flight.time[0]), begun.positions, begun.velocities)
    driven = drive(line, spline(flight.time, flight.position), constant((*air, 0.0)))
    return simulate(line, driven, begun, flight.time).positions[:, 0]


def told(flight, air, datum, random):
    """Samples with noise and an error that stays, of the position and of the wind."""
    stays, off = SIGMA * random.normal(size=3), OF_WIND * random.normal(size=2)
    places = flight.position + stays + 0.3 * random.normal(size=flight.position.shape)
    speeds = flight.velocity + 0.3 * random.normal(size=flight.position.shape)
    for t, *place, up, velocity in zip(
        flight.time, *to_geodetic(datum, *places.T), places[:, 2], speeds, strict=True
    ):
        yield Sample(
            float(t), round(1e9 * t), 0, latitude=place[0], longitude=place[1],
            altitude_amsl=place[2], height_above_home=float(up), velocity=tuple(velocity),
            airspeed=flight.airspeed, wind=(air[0] + off[0], air[1] + off[1], 0.0),
            wind_accuracy=OF_WIND, horizontal_accuracy=SIGMA,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("air", "sense", "latitude"), [((3.0, -2.0), 1, 47.4), ((0.0, 0.0), -1, -33.0)]
)
@pytest.mark.parametrize("begins", ["straight", "on the circle"])
def test_true_places_lie_in_its_regions_from_the_first_value_on(air, sense, latitude, begins):
    flight = simulate_flight(RADIUS, SPEED, 4, sense=sense, wind=air, rate=2.0)
    truth, datum = true_places(flight, air), Datum(latitude, 8.5, 400.0, False)
    # before the cable has forgotten how it came onto the circle
    first = 0 if begins == "straight" else np.flatnonzero(np.isfinite(flight.radius))[3]
    inside = {state: [] for state in (TwinState.SETTLING, TwinState.SYNCHRONISED)}
    for seed in (1, 3):
        predictor = Predictor(DRONE, with_twin=True)
        samples = list(told(flight, air, datum, np.random.default_rng(seed)))
        for sample, there in zip(samples[first:], truth[first:], strict=True):
            found = predictor.update(sample).simulated
            if found is None or found.state is TwinState.WAITING:
                continue
            here = to_enu(datum, *predictor.to_geodetic(found.position[None])[0])
            inside[found.state].append(in_region(here - there, found.covariance[:3, :3]))
    assert all(len(found) > 30 for found in inside.values())
    # 95 %; the errors that stay are drawn twice alone
    assert np.mean(inside[TwinState.SETTLING]) > 0.95
    assert np.mean(inside[TwinState.SYNCHRONISED]) > 0.85


def test_winds_that_are_off_add_up_to_the_covariance_and_change_as_little_as_it_does():
    random = np.random.default_rng(2)
    for _ in range(20):
        a = random.normal(size=(2, 2))
        covariance = a @ a.T
        off = off_winds(covariance)
        assert off[:, :2].T @ off[:, :2] == pytest.approx(covariance)
        assert np.all(off[:, 2] == 0.0)
    # nearly round: its axes are anywhere, what it does is not
    near = [off_winds(np.eye(2) + e * np.array([[1.0, 0.5], [0.5, 0.0]])) for e in (1e-6, -1e-6)]
    assert near[0] == pytest.approx(near[1], abs=1e-5)


def through(flight, air, gap, seed):
    """The twin's values beside the truth, by time, of a flight with no telemetry in a gap."""
    truth, datum = true_places(flight, air), Datum(47.4, 8.5, 400.0, False)
    predictor, found = Predictor(DRONE, with_twin=True), {}
    samples = told(flight, air, datum, np.random.default_rng(seed))
    for sample, there in zip(samples, truth, strict=True):
        if not gap[0] < sample.time < gap[1]:
            simulated = predictor.update(sample).simulated
            if simulated is None or simulated.state is TwinState.WAITING:
                continue
            here = to_enu(datum, *predictor.to_geodetic(simulated.position[None])[0])
            found[sample.time] = simulated, here - there
    return found


@pytest.mark.parametrize(("air", "sense"), [((3.0, -2.0), 1), ((-1.0, 4.0), -1)])
def test_a_gap_of_nearly_half_a_turn_is_led_through_between_both_its_ends(air, sense):
    flight = simulate_flight(RADIUS, SPEED, 4, sense=sense, wind=air, rate=2.0)
    found, complete = (through(flight, air, gap, 2) for gap in ((60.0, 69.0), (0.0, 0.0)))
    after = [time for time in found if 69.0 <= time < 84.0]
    assert len(after) == 30
    assert all(found[t][0].state is TwinState.SYNCHRONISED for t in after)
    assert not found[after[-1]][0].losses
    # the filter's way alone led 9 m off
    assert max(np.linalg.norm(found[t][1] - complete[t][1]) for t in after) < 3.0


def test_what_a_gaps_end_is_off_the_orbit_counts_as_an_error_until_it_is_forgotten():
    air, wider = (2.0, 0.0), 1.5 * RADIUS
    flight = simulate_flight(RADIUS, SPEED, 5, wind=air, rate=2.0, radius_change=(wider, 2.5))
    # the radius begins to change in it
    begins = flight.time[np.flatnonzero(flight.radius == wider)[0]] - 10.0
    found = through(flight, air, (begins, begins + 7.0), 1)
    after = [value for time, value in found.items() if time >= begins + 7.0]
    stated = [np.trace(f.covariance[:3, :3]) for f, _ in after]
    before = np.trace(found[begins][0].covariance[:3, :3])
    assert not after[0][0].losses
    assert stated[1] > before + 20.0
    assert stated[60] < before + 5.0
    assert np.mean([in_region(off, f.covariance[:3, :3]) for f, off in after[:60]]) > 0.9
