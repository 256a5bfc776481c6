"""A prediction as a flat record: every figure under a name with its unit, ready for JSON or CSV.

Tables, `~/prediction` and `/diagnostics` all show these records, so that a figure has one name.
"""

from math import isfinite
from typing import Any

import numpy as np

from ctcbs_ros.orbit.orbit import Orbit
from ctcbs_ros.orbit.wind import Wind
from ctcbs_ros.prediction.codes import Warning
from ctcbs_ros.prediction.prediction import (
    EndMass,
    EndMassState,
    Jump,
    Margin,
    MarginOf,
    Prediction,
)
from ctcbs_ros.twin.simulated import Simulated, TwinState

Record = dict[str, Any]


def prediction_record(prediction: Prediction) -> Record:
    """All that a prediction says.

    Returns
    -------
    dict
        Sections `sample_fields`, `orbit_fields` and `end_mass_fields`, each absent where the
        prediction has no such part, and "warnings", a list of {code, level, text}. What is
        infinite or not known is None.
    """
    record = sample_fields(prediction)
    if prediction.orbit is not None:
        record |= orbit_fields(prediction.orbit)
        record["air_density_kg_m3"] = finite(prediction.air_density)
    if prediction.skip is None:
        record |= wind_fields(prediction.wind)
    if prediction.end_mass is not None:
        record |= end_mass_fields(prediction.end_mass)
    if prediction.simulated is not None:
        record |= simulated_fields(prediction.simulated, prediction.end_mass)
    record["warnings"] = [warning_record(warning) for warning in prediction.warnings]
    return record


def warning_record(warning: Warning) -> Record:
    """One warning."""
    return {"code": warning.code.value, "level": warning.level.value, "text": warning.text}


def sample_fields(prediction: Prediction) -> Record:
    """When the sample was taken, why it was not used (or None), and the measured tow point."""
    record: Record = {
        "vehicle_time_s": finite(prediction.time),
        "stamp_ns": prediction.stamp_ns,
        "flight": prediction.flight,
        "skip": prediction.skip.value if prediction.skip else None,
        "valid": prediction.valid,
        "pose_holds": prediction.pose_holds,
    }
    if prediction.tow_point is not None:
        record |= _enu("tow_point", prediction.tow_point)
    return record


def orbit_fields(orbit: Orbit) -> Record:
    """The circle flown."""
    return {
        **_enu("orbit_center", orbit.center),
        "orbit_radius_m": finite(orbit.radius),
        "orbit_speed_m_s": finite(orbit.speed),
        "orbit_angular_rate_rad_s": finite(orbit.angular_rate),
        "orbit_sense": sense_name(orbit.sense),
        "orbit_phase_rad": finite(orbit.phase),
        "orbit_climb_rate_m_s": finite(orbit.climb_rate),
        "orbit_rms_residual_m": finite(orbit.rms_residual),
        "orbit_arc_rad": finite(orbit.arc),
        "orbit_samples": orbit.samples,
        "orbit_radius_std_m": finite(np.sqrt(orbit.covariance[3, 3])),
    }


_WIND_FIELDS = (
    "wind_source", "wind_east_m_s", "wind_north_m_s", "wind_east_std_m_s", "wind_north_std_m_s",
    "wind_speed_m_s", "wind_from_deg", "wind_note",
)  # fmt: skip


def wind_fields(wind: Wind | None) -> Record:
    """The wind believed; no direction where it is weaker than its error, nothing where unknown."""
    if wind is None:
        return dict.fromkeys(_WIND_FIELDS)
    east, north = np.sqrt(np.diag(wind.covariance))
    return {
        "wind_source": wind.source.value,
        # To 1 um/s, as from a bearing what is nought comes to 1e-15.
        "wind_east_m_s": finite(round(float(wind.velocity[0]), 6)),
        "wind_north_m_s": finite(round(float(wind.velocity[1]), 6)),
        "wind_east_std_m_s": finite(east),
        "wind_north_std_m_s": finite(north),
        "wind_speed_m_s": finite(wind.speed),
        "wind_from_deg": finite(wind.from_direction) if wind.speed > wind.sigma else None,
        "wind_note": wind.note,
    }


def end_mass_fields(end_mass: EndMass) -> Record:
    """The end mass on the tracked branch, the nearest jumps and the other steady states.

    Its place is None where it does not hold: of still air in a wind.
    """
    place = _place(end_mass)
    return {
        "branch": end_mass.branch,
        "method": end_mass.method,
        **(place if end_mass.holds else dict.fromkeys(place)),
        **state_fields(end_mass.state),
        **_margin(end_mass.margin),
        **_motion_in_wind(end_mass),
        "settling_time_s": finite(end_mass.settling_time),
        "time_on_orbit_s": finite(end_mass.time_on_orbit),
        "settled": end_mass.settled,
        "nearest_loss": end_mass.nearest_loss,
        "jumps_of": MarginOf.STILL_AIR.value,
        "jump_margin": finite(end_mass.jump_margin),
        "fold_distance_std": finite(end_mass.fold_distance),
        **_jump("angular_rate", "rad_s", end_mass.jump_in_angular_rate),
        **_jump("speed", "m_s", end_mass.jump_in_speed),
        **_jump("radius", "m", end_mass.jump_in_radius),
        "other_solutions": [state_fields(other) for other in end_mass.others],
    }


def _place(end_mass: EndMass) -> Record:
    """Where the end mass is predicted now, and about which place."""
    geodetic = end_mass.geodetic
    east, north, up = np.sqrt(np.diag(end_mass.covariance)[:3])
    return {
        **_enu("end_mass", end_mass.position),
        "end_mass_yaw_rad": finite(end_mass.yaw),
        "end_mass_east_std_m": finite(east),
        "end_mass_north_std_m": finite(north),
        "end_mass_up_std_m": finite(up),
        "end_mass_latitude_deg": finite(geodetic.latitude),
        "end_mass_longitude_deg": finite(geodetic.longitude),
        "end_mass_altitude_m": finite(geodetic.altitude),
        "end_mass_altitude_above": altitude_reference(geodetic.ellipsoidal),
        "end_mass_height_above_home_m": finite(end_mass.height_above_home),
        **_enu("end_mass_mean", end_mass.circle_center),
        "end_mass_excursion_m": finite(end_mass.excursion),
        "end_mass_lowest_above_home_m": finite(end_mass.lowest_height_above_home),
    }


def simulated_fields(simulated: Simulated, end_mass: EndMass | None) -> Record:
    """The twin's end mass, its distance from the predicted one, and its look-ahead."""
    east, north, up = np.sqrt(np.diag(simulated.covariance)[:3])
    begun = simulated.state is not TwinState.WAITING
    apart = None
    if end_mass is not None and end_mass.holds and begun:
        apart = finite(np.linalg.norm(simulated.position - end_mass.position))
    settling = simulated.settling
    nowhere = np.full(3, np.nan)
    return {
        "simulated_state": simulated.state.value,
        "simulated_begun_as": simulated.begun_as or None,
        "simulated_since_s": finite(simulated.since),
        "simulated_valid_from_s": finite(simulated.valid_from),
        **_enu("simulated", simulated.position),
        "simulated_yaw_rad": finite(simulated.yaw),
        "simulated_east_std_m": finite(east) if begun else None,
        "simulated_north_std_m": finite(north) if begun else None,
        "simulated_up_std_m": finite(up) if begun else None,
        "simulated_from_predicted_m": apart,
        "simulated_wind_known": simulated.wind_known,
        "simulated_restarts": sum(simulated.losses.values()),
        "ahead_ending": settling.ending.value if settling else None,
        "ahead_settles_in_s": finite(simulated.settles_in),
        "ahead_age_s": finite(simulated.look_ahead_age),
        **_enu("ahead_mean", settling.mean if settling else nowhere),
        "ahead_radius_m": finite(settling.radius) if settling else None,
        "ahead_least_distance_m": finite(settling.least_distance) if settling else None,
        "ahead_greatest_distance_m": finite(settling.greatest_distance) if settling else None,
    }


def state_fields(state: EndMassState) -> Record:
    """One steady state."""
    return {
        "end_mass_radius_m": finite(state.radius),
        "end_mass_depth_m": finite(state.depth),
        "phase_lag_rad": finite(state.phase_lag),
        "tension_end_mass_n": finite(state.tension_end_mass),
        "tension_tow_point_n": finite(state.tension_tow_point),
        "greatest_tension_n": finite(state.greatest_tension),
        "margin_per_rad": finite(state.margin),
        "margin_per_s": finite(state.margin_per_s),
        "frequency_rad_s": finite(state.frequency_per_s),
        "stable": state.stable,
        "residual": finite(state.residual),
    }


def sense_name(sense: int) -> str:
    """ "ccw" for +1, "cw" for -1, seen from above."""
    return "ccw" if sense > 0 else "cw"


def altitude_reference(ellipsoidal: bool) -> str:
    """What a geodetic altitude is above."""
    return "ellipsoid" if ellipsoidal else "mean sea level"


def finite(value: float) -> float | None:
    """A number that JSON can hold: None for what is infinite or not known."""
    value = float(value)
    return value if isfinite(value) else None


def _enu(name: str, position: np.ndarray) -> Record:
    return {
        f"{name}_{axis}_m": finite(value)
        for axis, value in zip(("east", "north", "up"), position, strict=True)
    }


def _margin(margin: Margin) -> Record:
    """How stable the motion predicted is, and whether in the wind or in still air."""
    return {
        "margin_of": margin.of.value,
        "margin_per_rad": finite(margin.per_radian),
        "margin_per_s": finite(margin.per_second),
        "frequency_rad_s": finite(margin.frequency),
        "stable": margin.stable,
    }


def _motion_in_wind(end_mass: EndMass) -> Record:
    """Whether the motion is that in the wind, by which method, and why not."""
    return {
        "wind_modelled": end_mass.in_wind is not None,
        "in_wind_source": end_mass.in_wind.source.value if end_mass.in_wind is not None else None,
        "wind_unmodelled_because": end_mass.unmodelled_because or None,
    }


def _jump(quantity: str, unit: str, jump: Jump | None) -> Record:
    return {
        f"jump_{quantity}_{unit}": finite(jump.at) if jump else None,
        f"jump_{quantity}_relative": finite(jump.relative) if jump else None,
        f"jump_{quantity}_landing_radius_m": finite(jump.landing_radius) if jump else None,
    }
