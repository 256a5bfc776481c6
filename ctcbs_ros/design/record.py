"""A design as JSON: every point, limit, remedy and figure, the unit at the end of each name."""

from dataclasses import asdict
from math import inf
from typing import Any

from ctcbs_ros import __version__
from ctcbs_ros.design.changes import change_named
from ctcbs_ros.design.chart import ChartColumn
from ctcbs_ros.design.design import Design
from ctcbs_ros.design.evaluation import Evaluation
from ctcbs_ros.design.limits import Limit
from ctcbs_ros.design.point import DesignPoint
from ctcbs_ros.design.remedies import Remedy
from ctcbs_ros.design.requirements import Criterion
from ctcbs_ros.design.text import verdict_line
from ctcbs_ros.design.way_in import WayIn

Record = dict[str, Any]


def design_record(design: Design) -> Record:
    """All of a design; what is infinite or not known is a float that JSON writes as null."""
    evaluation = design.evaluation
    configuration, requirements = evaluation.configuration, evaluation.requirements
    return {
        "verdict": "OK" if design.good else "NOT OK",
        "text": verdict_line(design),
        "cautions": [asdict(caution) for caution in design.cautions],
        "version": __version__,
        "source": configuration.source,
        "cable": asdict(configuration.cable),
        "end_mass": asdict(configuration.end_mass),
        "air_density_kg_m3": evaluation.density,
        "envelope_radius_m": list(configuration.envelope.radius),
        "envelope_speed_m_s": list(configuration.envelope.speed),
        "requirements": {
            "end_mass_radius_m": requirements.end_mass_radius,
            "end_mass_radius_share": requirements.end_mass_radius_share,
            "margin_per_s": requirements.margin,
            "tension_share": requirements.tension,
            "way_in": requirements.way_in,
        },
        "limits": [_limit(limit) for limit in design.limits],
        "remedies": [_remedy(remedy) for remedy in design.remedies],
        "deploy_in_straight_flight": design.straight_deployment_helps,
        "good_radii": [
            {"speed_m_s": speed, "radius_m": [list(interval) for interval in intervals]}
            for speed, intervals in design.good_radii.items()
        ],
        "chart": [_column(column) for column in design.chart],
        "points": [
            _point(point, evaluation.violations(point)) for point in evaluation.points
        ],
        "deployments": [_way_in(way, evaluation) for way in evaluation.deployments],
        "entries": [_way_in(way, evaluation) for way in evaluation.entries],
    }


def _names(criteria: tuple[Criterion, ...]) -> list[str]:
    return [criterion.value for criterion in criteria]


def _point(point: DesignPoint, violations: tuple[Criterion, ...]) -> Record:
    flight = point.flight
    record: Record = {
        "radius_m": flight.radius,
        "speed_m_s": flight.speed,
        "cable_length_m": flight.cable_length,
        "good": not violations,
        "violations": _names(violations),
        "solutions": point.solutions,
    }
    if point.state is None:
        return {**record, "reason": point.reason}
    state = flight.state_si(point.state, point.damping)
    return {
        **record,
        **state,
        "end_mass_radius_share": point.end_mass_radius_share,
        "stable": point.stable,
        "margin_per_s": point.margin,
        "nearest_loss": point.damping.nearest_loss,
        "jump_speed_m_s": point.jump_in_speed,
        "jump_radius_m": point.jump_in_radius,
    }


def _way_in(way: WayIn, evaluation: Evaluation) -> Record:
    violations = evaluation.way_in_violations(way)
    return {
        "kind": way.kind,
        "radius_m": way.radius,
        "speed_m_s": way.speed,
        "good": not violations,
        "violations": _names(violations),
        "jumps": [
            {
                "radius_m": jump.radius,
                "cable_length_m": jump.cable_length,
                "end_mass_radius_m": jump.before,
                "landing_radius_m": jump.after,
            }
            for jump in way.jumps
        ],
        "stability_changes": [
            {
                "radius_m": change.radius,
                "cable_length_m": change.cable_length,
                "becomes_stable": change.becomes_stable,
                "frequency_rad_s": change.frequency,
            }
            for change in way.changes
        ],
        "points": [_point(point, evaluation.violations(point, False)) for point in way.points],
    }


def _limit(limit: Limit) -> Record:
    return {
        "criterion": limit.criterion.value,
        "phase": limit.phase,
        "good": limit.good,
        "text": limit.text,
        "value": limit.value,
        "limit": limit.limit,
        "unit": limit.unit,
        "use": limit.use,
        "radius_m": limit.radius,
        "speed_m_s": limit.speed,
        "cable_length_m": limit.cable_length,
        "violated": limit.violated,
        "judged": limit.judged,
    }


def _remedy(remedy: Remedy) -> Record:
    change = change_named(remedy.change)
    return {
        "change": remedy.change,
        "found": remedy.found,
        "quantity": change.quantity,
        "bound": remedy.bound,
        "value": remedy.value,
        "unit": change.unit,
        "present": remedy.present,
        "not_enough": remedy.missed,
        "tried_up_to": remedy.furthest,
        "settings": {
            key: list(value) if isinstance(value, tuple) else value
            for key, value in remedy.settings.items()
        },
        "remark": change.remark,
        "still": list(remedy.still),
    }


def _column(column: ChartColumn) -> Record:
    p = column.parameters
    return {
        "radius_m": column.radius,
        "omega": list(column.omega),
        "length": p.length,
        "end_mass": p.end_mass,
        "cable_drag": p.cable_drag,
        "end_mass_drag": p.end_mass_drag,
        "drag_ratio": p.drag_ratio,
        "elasticity": p.elasticity,
        "outside_table_2_1": list(column.outside_table_2_1),
        "cusp": column.cusp and asdict(column.cusp),
        "above_cusp": column.above_cusp,
        "omega_max": column.omega_max,
        "required_unique": column.critical.unique,
        "required_stable": column.critical.stable,
        "required": column.critical.required,
        "none_suffices": column.critical.required == inf,
        "enough_drag": column.enough_drag,
        "minimum_speed_m_s": column.minimum_speed,
        "minimum_radius_m": column.minimum_radius,
        "note": column.note,
    }
