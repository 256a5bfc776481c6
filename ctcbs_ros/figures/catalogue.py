"""The thesis's figures: what is in each, with which parameters, and how it is drawn."""

from functools import partial

from ctcbs_ros.figures import curves
from ctcbs_ros.figures.draw_curves import draw_curves
from ctcbs_ros.figures.figure import Figure
from ctcbs_ros.solver.diagram import VARIED
from ctcbs_ros.solver.parameters import Parameters

_SLOWEST = 0.02
_MODEL = "steady state inextensible, gamma 600 in the vibration, as in the thesis"


def _against_omega(name: str, fastest: float, **parameters: float):
    """A call for the branches of one parameter point from omega 0.02 up."""
    point = Parameters(omega=1.0, **parameters)
    return (curves.curve, (name, point, VARIED["omega"], 1.0, _SLOWEST, fastest))


def _figure_3_1() -> Figure:
    fixed = {"length": 3.0, "end_mass": 50.0, "drag_ratio": 1.0}

    def given(omega, radius, note):
        return {
            "kind": "thesis", "curve": "d_n 4.8", "cable_drag": 4.8, "omega": omega,
            "end_mass_radius": radius, "note": note, **fixed,
        }  # fmt: skip

    return Figure(
        number="3.1",
        title="end-mass radius against angular velocity (l = 3, m = 50, f = 1)",
        note=f"{_MODEL}; the thesis does not show stability here",
        columns=curves.COLUMNS,
        calls=tuple(
            _against_omega(f"d_n {drag:g}", 3.0, cable_drag=drag, **fixed)
            for drag in (2.7, 4.8, 6.2, 10.0)
        ),
        given=(
            given(1.1, 2.3, "jump with rising omega: from"),
            given(1.1, 0.5, "jump with rising omega: to"),
            given(0.9, 1.3, "jump with falling omega: from"),
            given(0.9, 2.5, "jump with falling omega: to"),
        ),
        draw=partial(
            draw_curves, limits=(0.0, 3.0, 0.0, 3.5),
            inset=((0.48, 0.2, 0.5, 0.3), (1.4, 3.0, 0.03, 0.26)),
        ),
    )


def _figure_4_1() -> Figure:
    fixed = {"length": 3.0, "end_mass": 3.5, "drag_ratio": 0.1}

    def unstable(drag, omega, note):
        return {
            "kind": "thesis range", "curve": f"d_n {drag:g}", "cable_drag": drag, "omega": omega,
            "note": note, **fixed,
        }  # fmt: skip

    return Figure(
        number="4.1",
        title="stability along the branches (l = 3, m = 3.5, f = 0.1)",
        note=f"{_MODEL}; the modes that count are those of Parameters.band",
        columns=curves.COLUMNS,
        calls=tuple(
            _against_omega(f"d_n {drag:g}", 4.0, cable_drag=drag, **fixed)
            for drag in (1.33, 2.0, 3.0)
        ),
        given=(
            unstable(1.33, 1.8, "unstable from"),
            unstable(1.33, 2.2, "unstable to"),
            unstable(1.33, 2.8, "unstable from"),
            unstable(1.33, 4.0, "unstable to"),
            unstable(2.0, 3.2, "unstable from"),
            unstable(2.0, 4.0, "unstable to"),
            {"kind": "thesis", "omega": 2.1, "note": "first minimum near 2.1", **fixed},
        ),
        draw=partial(
            draw_curves, limits=(0.0, 4.0, 0.0, 2.5),
            inset=((0.36, 0.36, 0.62, 0.6), (1.6, 4.0, 0.25, 0.4)),
        ),
    )


FIGURES = {figure.number: figure for figure in (_figure_3_1(), _figure_4_1())}
