"""The tables of a replay, as CSV: a row a valid prediction, a sample, a report of the beacon."""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TextIO

from ctcbs_ros.beacon.record import MEASURED, names
from ctcbs_ros.prediction.record import Record

TIME = ("time_s", "vehicle_time_s", "stamp_ns", "flight")
TOW_POINT = ("tow_point_east_m", "tow_point_north_m", "tow_point_up_m")
# predictions.csv
PREDICTION_COLUMNS = (
    *TIME,
    *TOW_POINT,
    "orbit_center_east_m",
    "orbit_center_north_m",
    "orbit_center_up_m",
    "orbit_radius_m",
    "orbit_speed_m_s",
    "orbit_angular_rate_rad_s",
    "orbit_sense",
    "orbit_phase_rad",
    "orbit_climb_rate_m_s",
    "orbit_rms_residual_m",
    "orbit_arc_rad",
    "orbit_samples",
    "orbit_radius_std_m",
    "air_density_kg_m3",
    "wind_source",
    "wind_east_m_s",
    "wind_north_m_s",
    "wind_east_std_m_s",
    "wind_north_std_m_s",
    "wind_speed_m_s",
    "wind_from_deg",
    "wind_note",
    "branch",
    "method",
    "end_mass_east_m",
    "end_mass_north_m",
    "end_mass_up_m",
    "end_mass_yaw_rad",
    "end_mass_east_std_m",
    "end_mass_north_std_m",
    "end_mass_up_std_m",
    "end_mass_latitude_deg",
    "end_mass_longitude_deg",
    "end_mass_altitude_m",
    "end_mass_altitude_above",
    "end_mass_height_above_home_m",
    "end_mass_radius_m",
    "end_mass_depth_m",
    "phase_lag_rad",
    "tension_end_mass_n",
    "tension_tow_point_n",
    "greatest_tension_n",
    "margin_of",
    "margin_per_rad",
    "margin_per_s",
    "frequency_rad_s",
    "stable",
    "residual",
    "pose_holds",
    "wind_modelled",
    "in_wind_source",
    "wind_unmodelled_because",
    "end_mass_mean_east_m",
    "end_mass_mean_north_m",
    "end_mass_mean_up_m",
    "end_mass_excursion_m",
    "end_mass_lowest_above_home_m",
    "settling_time_s",
    "time_on_orbit_s",
    "settled",
    "nearest_loss",
    "jumps_of",
    "jump_margin",
    "fold_distance_std",
    "jump_angular_rate_rad_s",
    "jump_angular_rate_relative",
    "jump_angular_rate_landing_radius_m",
    "jump_speed_m_s",
    "jump_speed_relative",
    "jump_speed_landing_radius_m",
    "jump_radius_m",
    "jump_radius_relative",
    "jump_radius_landing_radius_m",
    "other_end_mass_radii_m",
    "simulated_state",
    "simulated_begun_as",
    "simulated_since_s",
    "simulated_valid_from_s",
    "simulated_east_m",
    "simulated_north_m",
    "simulated_up_m",
    "simulated_yaw_rad",
    "simulated_east_std_m",
    "simulated_north_std_m",
    "simulated_up_std_m",
    "simulated_from_predicted_m",
    "simulated_wind_known",
    "simulated_restarts",
    "ahead_ending",
    "ahead_settles_in_s",
    "ahead_age_s",
    "ahead_mean_east_m",
    "ahead_mean_north_m",
    "ahead_mean_up_m",
    "ahead_radius_m",
    "ahead_least_distance_m",
    "ahead_greatest_distance_m",
    "warnings",
)
# samples.csv
SAMPLE_COLUMNS = (
    *TIME, "skip", "valid", *TOW_POINT, "simulated_state", "simulated_east_m",
    "simulated_north_m", "simulated_up_m", "warnings",
)  # fmt: skip

# beacon.csv
BEACON_COLUMNS = (
    *TIME, "outcome", "time_by", "time_std_s", *MEASURED, *names("predicted"),
    "simulated", *names("simulated"),
)  # fmt: skip

PREDICTIONS, SAMPLES, BEACON = "predictions.csv", "samples.csv", "beacon.csv"


class ReplayTables:
    """Writes the tables into a folder, record by record; that of the beacon where there is one.

    `time_s` counts from the first sample that was believed and is empty before it; what is
    infinite or not known is empty too. Several warnings in a cell stand apart by semicolons.
    """

    def __init__(self, folder: Path, with_beacon: bool = False):
        self._files: list[TextIO] = []
        self._predictions = self._writer(folder / PREDICTIONS, PREDICTION_COLUMNS)
        self._samples = self._writer(folder / SAMPLES, SAMPLE_COLUMNS)
        self._beacon = self._writer(folder / BEACON, BEACON_COLUMNS) if with_beacon else None
        self._first_time: float | None = None
        self._timeless: list[Record] = []  # of the beacon, before the first time is known

    def add(self, record: Record) -> None:
        """Write the rows of one record."""
        if self._first_time is None and record["skip"] is None:
            self._first_time = record["vehicle_time_s"]
            self._write_timeless()
        row = record | {
            "time_s": self._since_first(record["vehicle_time_s"]),
            # Radius and speed can both be outside the envelope: one code, once.
            "warnings": _joined(dict.fromkeys(w["code"] for w in record["warnings"])),
        }
        self._samples.writerow(row)
        if record["valid"]:
            radii = (other["end_mass_radius_m"] for other in record["other_solutions"])
            self._predictions.writerow(row | {"other_end_mass_radii_m": _joined(radii)})

    def add_comparison(self, record: Record) -> None:
        """Write the row of one report of the beacon."""
        self._timeless.append(record)
        if self._first_time is not None:
            self._write_timeless()

    def _write_timeless(self) -> None:
        for record in self._timeless:
            time = self._since_first(record["vehicle_time_s"])
            self._beacon.writerow(record | {"time_s": time})
        self._timeless.clear()

    def close(self) -> None:
        """Finish the files."""
        self._write_timeless()
        for file in self._files:
            file.close()

    def _since_first(self, time: float | None) -> float | None:
        if time is None or self._first_time is None:
            return None
        return round(time - self._first_time, 9)

    def _writer(self, path: Path, columns: tuple[str, ...]) -> csv.DictWriter:
        file = open(path, "w", newline="", encoding="utf-8")  # noqa: SIM115, closed by `close`
        self._files.append(file)
        writer = csv.DictWriter(file, columns, extrasaction="ignore")
        writer.writeheader()
        return writer


def _joined(items: Iterable[Any]) -> str:
    return ";".join(str(item) for item in items)
