"""The thesis's figures: what is in each, with which parameters, and how it is drawn."""

from functools import partial

from ctcbs_ros.figures import boundaries, curves, design
from ctcbs_ros.figures.draw_boundaries import draw_cusps, draw_folds, draw_least_drags
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


_FOLD_PATHS = (
    boundaries.fold_paths,
    (Parameters(1.0, 3.0, 50.0, 1.0, 1.0), (_SLOWEST, 3.0), (0.01, 20.0)),
)
# Table 2.1's range of cable length.
_LENGTHS = tuple(1.5 + 0.25 * i for i in range(19))


def _over_length(function, masses, ratios, step: int = 1):
    """Calls for every length, each curve of an end mass and a drag ratio."""
    return tuple(
        (function, (f"m {mass:g}, f {ratio:g}", length, mass, ratio))
        for ratio in ratios
        for mass in masses
        for length in _LENGTHS[::step]
    )


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
        calls=(
            _FOLD_PATHS,
            *(_against_omega(f"d_n {drag:g}", 3.0, cable_drag=drag, **fixed)
            for drag in (2.7, 4.8, 6.2, 10.0)),
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


def _figure_3_2() -> Figure:
    return Figure(
        number="3.2",
        title="angular velocity at the folds against cable drag (l = 3, m = 50, f = 1)",
        note="inextensible; the parameters are those of Fig. 3.1, whose folds they are",
        columns=boundaries.FOLD_COLUMNS,
        calls=(_FOLD_PATHS,),
        given=({"kind": "thesis", "cable_drag": 6.2, "note": "no jumps above, thesis's text"},),
        draw=partial(draw_folds, limits=(0.0, 7.0, 0.7, 2.2)),
    )


def _figure_3_3() -> Figure:
    return Figure(
        number="3.3",
        title="least cable drag for a unique solution at every angular velocity up to 3",
        note="inextensible; l, m and f as named; a cusp, or a fold that leaves the range of "
        "omega, whichever needs more drag",
        columns=boundaries.LEAST_DRAG_COLUMNS,
        calls=_over_length(boundaries.least_unique_drag, (20.0, 50.0, 100.0), (1.0, 2.0)),
        given=(),
        draw=draw_least_drags,
    )


def _figure_3_4() -> Figure:
    def design_point(length, omega, note):
        return {"kind": "thesis", "length": length, "omega": omega, "note": note}

    return Figure(
        number="3.4",
        title="the cusp, and the first minimum of the end-mass radius at its drag (f = 1)",
        note="inextensible; the thesis does not say at which cable drag the minimum is: here at "
        "the cusp's own, the least for a unique solution",
        columns=boundaries.CUSP_COLUMNS,
        calls=_over_length(boundaries.cusp_and_minimum, (50.0, 100.0), (1.0,)),
        given=(
            design_point(2.0, 1.0, "short of the cusp"),
            design_point(4.0, 1.0, "beyond the cusp: acceptable"),
            design_point(5.0, 1.6, "acceptable"),
        ),
        draw=draw_cusps,
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


def _figure_4_2() -> Figure:
    return Figure(
        number="4.2",
        title="least cable drag for stable solutions",
        note=f"{_MODEL}; with every greater drag up to 2000 the state at the first minimum of the "
        "end-mass radius is stable, wherever there is one up to omega 10, as the thesis asks; "
        "and, beyond the thesis, every state on the branch from omega 0 up to omega 3; where a "
        "curve ends there is no first minimum, or more drag is needed for uniqueness (Fig. 3.3)",
        columns=boundaries.LEAST_DRAG_COLUMNS,
        calls=(
            *_over_length(boundaries.least_stable_drag, (20.0, 50.0, 100.0), (1.0, 2.0)),
            *_over_length(
                boundaries.least_drag_stable_everywhere, (20.0, 50.0, 100.0), (1.0, 2.0), step=2
            ),
        ),
        given=(),
        draw=draw_least_drags,
    )


_DESIGNS = tuple(
    (f"A_C {area:g} m², {'elastic' if elastic else 'inextensible'}", area, elastic)
    for area in (design.FIRST, design.SECOND)
    for elastic in (False, True)
)
_DESIGN_NOTE = (
    "Table 5.1; the thesis's numbers for f 0.04 belong to a frontal area of 0.00196 m², those "
    "for f 0.1 to 0.045 m² (f 1.0 at 250 m); inextensible: gamma 600 in the vibration; "
    "elastic: E 2 GPa"
)


def _design_given(x: str, *points: tuple[float, float, str]):
    return tuple(
        {"kind": "thesis", x: value, "end_mass_radius": radius, "note": note}
        for value, radius, note in points
    )


def _figure_5_2() -> Figure:
    return Figure(
        number="5.2",
        title="design example, end-mass radius against tow radius (V = 50 m/s, L = 1000 m)",
        note=_DESIGN_NOTE,
        columns=design.COLUMNS,
        calls=tuple((design.against_radius, each) for each in _DESIGNS),
        given=_design_given(
            "tow_radius_m", (250.0, 0.15, "f 0.04"), (250.0, 0.08, "f 0.1"),
            (100.0, 8.43e-3, "f 0.1"),
        ),
        draw=partial(
            draw_curves, x="tow_radius_m", limits=(95.0, 255.0, 0.005, 0.2), log_radius=True
        ),
    )  # fmt: skip


def _figure_5_3() -> Figure:
    return Figure(
        number="5.3",
        title="design example, end-mass radius as the cable is deployed (V = 50 m/s, a = 250 m)",
        note=f"{_DESIGN_NOTE}; the thesis does not give a, but its l of 4 at L 1000 m is 250 m",
        columns=design.COLUMNS,
        calls=tuple((design.against_length, each) for each in _DESIGNS),
        given=_design_given("length", (4.0, 0.15, "f 0.04"), (4.0, 0.08, "f 0.1")),
        draw=partial(draw_curves, x="length", limits=(0.0, 4.05, 0.0, 1.2)),
    )


def _figure_d_1() -> Figure:
    fixed = {"length": 3.0, "end_mass": 50.0, "cable_drag": 10.0}
    return Figure(
        number="D.1",
        title="end-mass radius for several drag ratios (l = 3, m = 50, d_n = 10)",
        note=f"{_MODEL}; the thesis gives neither l, m, d_n nor f here: those of Fig. 3.1 where "
        "it is single-valued, and the range of Table 2.1",
        columns=curves.COLUMNS,
        calls=tuple(
            _against_omega(f"f {ratio:g}", 3.0, drag_ratio=ratio, **fixed)
            for ratio in (0.1, 0.5, 1.0, 2.0, 4.0)
        ),
        given=(),
        draw=partial(
            draw_curves, limits=(0.0, 3.0, 0.0, 3.0),
            inset=((0.5, 0.3, 0.48, 0.45), (1.4, 3.0, 0.03, 0.27)),
        ),
    )


FIGURES = {
    figure.number: figure
    for figure in (
        _figure_3_1(), _figure_3_2(), _figure_3_3(), _figure_3_4(), _figure_4_1(), _figure_4_2(),
        _figure_5_2(), _figure_5_3(), _figure_d_1(),
    )
}
