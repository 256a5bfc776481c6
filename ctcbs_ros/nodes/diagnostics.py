"""The state of telemetry, orbit and prediction as diagnostics: every figure and every warning."""

from collections.abc import Iterable
from math import isfinite, isnan
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from ctcbs_ros.prediction.codes import Level, Warning, WarningCode
from ctcbs_ros.prediction.prediction import EndMass, Prediction
from ctcbs_ros.prediction.record import (
    Record,
    end_mass_fields,
    finite,
    orbit_fields,
    simulated_fields,
    wind_fields,
)
from ctcbs_ros.prediction.tally import Tally
from ctcbs_ros.telemetry.skip_code import SkipCode

LEVELS = {Level.WARN: DiagnosticStatus.WARN, Level.ERROR: DiagnosticStatus.ERROR}
# Where a warning is reported, if not under "prediction".
TELEMETRY_WARNINGS = {WarningCode.BAD_FIX, WarningCode.STALE_TELEMETRY}
ORBIT_WARNINGS = {WarningCode.NOT_ORBITING, WarningCode.OUTSIDE_ENVELOPE}


class Monitor:
    """Turns what has come since the last report into the next one.

    Attributes
    ----------
    tally : Tally
        Counts since the start.
    """

    def __init__(self):
        self.tally = Tally()
        self._newest: Prediction | None = None  # of a sample that was used
        self._of_telemetry: dict[WarningCode, Warning] = {}

    def add(self, prediction: Prediction) -> None:
        """Take in the prediction of one more sample."""
        self.tally.add(prediction)
        if prediction.skip is None:
            self._newest = prediction
        for warning in prediction.warnings:
            if warning.code in TELEMETRY_WARNINGS:
                self._of_telemetry[warning.code] = warning

    def warn(self, warning: Warning) -> None:
        """Take in a warning about the telemetry for the next report."""
        self._of_telemetry[warning.code] = warning

    def report(self, silence: Warning | None, figures: Record) -> list[DiagnosticStatus]:
        """Status of telemetry, orbit and prediction.

        Parameters
        ----------
        silence : Warning or None
            That no sample comes; what was predicted is then out of date and not reported.
        figures : dict
            What is known about the source.
        """
        if silence is not None:
            self._of_telemetry[silence.code] = silence
        telemetry = _status(
            "telemetry", self._of_telemetry.values(), "samples come in", figures | self._counts()
        )
        self._of_telemetry = {}
        if silence is not None or self._newest is None:
            return [telemetry, _no_telemetry("orbit"), _no_telemetry("prediction")]
        return [telemetry, orbit_status(self._newest), prediction_status(self._newest)]

    def _counts(self) -> Record:
        tally = self.tally
        return {
            "samples": tally.samples,
            "valid predictions": tally.predictions,
            **{f"skipped {code.value}": tally.skipped[code.value] for code in SkipCode},
            **{f"warned {code.value}": tally.warnings[code.value] for code in WarningCode},
        }


def orbit_status(prediction: Prediction) -> DiagnosticStatus:
    """Status of the orbit, from the prediction of a sample that was used."""
    warnings = [w for w in prediction.warnings if w.code in ORBIT_WARNINGS]
    if prediction.orbit is None:
        return _status("orbit", warnings, "no orbit", wind_fields(prediction.wind))
    figures = orbit_fields(prediction.orbit)
    figures["air_density_kg_m3"] = finite(prediction.air_density)
    figures |= wind_fields(prediction.wind)
    return _status("orbit", warnings, "orbiting", figures)


def prediction_status(prediction: Prediction) -> DiagnosticStatus:
    """Status of the prediction of a sample that was used."""
    elsewhere = TELEMETRY_WARNINGS | ORBIT_WARNINGS
    warnings = [w for w in prediction.warnings if w.code not in elsewhere]
    if prediction.end_mass is not None:
        figures = end_mass_fields(prediction.end_mass)
        # Silence must not be taken for safety.
        figures["pose_holds"] = prediction.pose_holds
        figures["ground proximity"] = _ground(prediction.end_mass)
        figures |= _twin(prediction)
        settling = _settling(prediction.end_mass)
        status = _status("prediction", warnings, settling, figures)
        if warnings and not prediction.end_mass.settled:
            status.message += f"; {settling}"
        return status
    status = _status("prediction", warnings, "no prediction: no orbit", _twin(prediction))
    status.level = max(status.level, DiagnosticStatus.WARN)
    return status


def _twin(prediction: Prediction) -> Record:
    if prediction.simulated is None:
        return {}
    losses = {
        f"simulation begun anew {code.value}": count
        for code, count in prediction.simulated.losses.items()
    }
    return simulated_fields(prediction.simulated, prediction.end_mass) | losses


def _ground(end_mass: EndMass) -> str:
    if not end_mass.holds:
        return "not judged: the wind is not modelled"
    if not isfinite(end_mass.height_above_home):
        return "not judged, no height above ground"
    return "judged"


def _settling(end_mass: EndMass) -> str:
    if not end_mass.holds:
        return "valid for still air only, no pose"
    if end_mass.settled:
        return "valid, settled"
    flown = f"{end_mass.time_on_orbit:.0f} s on this orbit"
    if isnan(end_mass.settling_time):
        return f"valid, when it settles in this wind is {end_mass.margin.of.value}: {flown}"
    if not isfinite(end_mass.settling_time):
        return f"valid, but nothing settles: {flown}"
    return f"valid, still settling: {flown} of {end_mass.settling_time:.0f} s"


def _no_telemetry(subject: str) -> DiagnosticStatus:
    return DiagnosticStatus(level=DiagnosticStatus.ERROR, name=subject, message="no telemetry")


def _status(
    subject: str, warnings: Iterable[Warning], otherwise: str, figures: Record
) -> DiagnosticStatus:
    warnings = tuple(warnings)
    status = DiagnosticStatus(
        level=max((LEVELS[w.level] for w in warnings), default=DiagnosticStatus.OK),
        name=subject,
        message="; ".join(f"{w.code.value}: {w.text}" for w in warnings) or otherwise,
    )
    status.values = [
        KeyValue(key=f"warning {w.code.value}", value=w.text) for w in warnings
    ] + list(key_values(figures))
    return status


def key_values(figures: Record, prefix: str = "") -> Iterable[KeyValue]:
    """Figures as pairs of texts; those inside of others with the outer name before a point."""
    for key, value in figures.items():
        if isinstance(value, dict):
            yield from key_values(value, f"{prefix}{key}.")
        elif isinstance(value, list):
            for number, inner in enumerate(value):
                if isinstance(inner, dict):
                    yield from key_values(inner, f"{prefix}{key}[{number}].")
                else:
                    yield KeyValue(key=f"{prefix}{key}[{number}]", value=_text(inner))
        else:
            yield KeyValue(key=f"{prefix}{key}", value=_text(value))


def _text(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.9g}" if isinstance(value, float) else str(value)
