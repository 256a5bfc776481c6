"""A design carried out: evaluated, its limits named, its chart drawn up, its remedies found."""

from collections.abc import Iterable
from concurrent.futures import Executor
from dataclasses import dataclass
from math import isfinite

from tqdm import tqdm

from ctcbs_ros.configuration import Configuration
from ctcbs_ros.design.chart import ChartColumn, chart_column
from ctcbs_ros.design.evaluation import Evaluation, Grid, assemble, evaluation_jobs, run_job
from ctcbs_ros.design.limits import Limit, jump_text, limiting, limits, place
from ctcbs_ros.design.radii import good_radii
from ctcbs_ros.design.remedies import Remedy, find_remedies
from ctcbs_ros.design.requirements import Requirements
from ctcbs_ros.design.way_in import DEPLOYMENT


@dataclass(frozen=True)
class Caution:
    """Something that is allowed, but that the flight will warn of or an engineer should weigh."""

    code: str
    text: str


@dataclass(frozen=True)
class Design:
    """The whole result.

    Attributes
    ----------
    evaluation : Evaluation
    limits : tuple of Limit
    cautions : tuple of Caution
    chart : tuple of ChartColumn
        At the smallest and the largest tow radius.
    good_radii : dict
        Speed [m/s] -> intervals of tow radius [m] that are good with all of the cable out.
    remedies : tuple of Remedy
        Empty where the verdict is good.
    """

    evaluation: Evaluation
    limits: tuple[Limit, ...]
    cautions: tuple[Caution, ...]
    chart: tuple[ChartColumn, ...]
    good_radii: dict[float, tuple[tuple[float, float], ...]]
    remedies: tuple[Remedy, ...]

    @property
    def good(self) -> bool:
        """Whether every point and every deployment meets every requirement."""
        return self.evaluation.good

    @property
    def limiting(self) -> Limit | None:
        """The gravest violated limit, or the one used up most."""
        return limiting(self.limits)

    @property
    def straight_deployment_helps(self) -> bool:
        """Whether a deployment on the circle fails, and no way in from straight flight does."""
        evaluation = self.evaluation
        return evaluation.entries_good and any(
            evaluation.way_in_violations(way) for way in evaluation.deployments
        )


def carry_out(
    configuration: Configuration,
    density: float,
    requirements: Requirements,
    grid: Grid | None = None,
    pool: Executor | None = None,
    progress: bool = False,
) -> Design:
    """Go through the design procedure.

    Parameters
    ----------
    configuration : Configuration
    density : float
        Of the air [kg/m^3].
    requirements : Requirements
    grid : Grid, optional
    pool : Executor, optional
        Spreads the work; without one it is done here.
    progress : bool
        Show a progress bar on standard error.

    Returns
    -------
    Design
    """
    grid = grid or Grid()
    with tqdm(desc="design", unit=" parts", total=0, disable=not progress) as bar:

        def run(function, jobs: Iterable) -> list:
            jobs = list(jobs)
            bar.total += len(jobs)
            bar.refresh()
            results = []
            for result in map(function, jobs) if pool is None else pool.map(function, jobs):
                results.append(result)
                bar.update()
            return results

        columns = [
            (chart_column, configuration, density, radius)
            for radius in configuration.envelope.radius
        ]
        # They take longest: begun first, collected last.
        begun = [pool.submit(run_job, column) for column in columns if pool is not None]
        parts = run(run_job, evaluation_jobs(configuration, density, requirements, grid))
        evaluation = assemble(configuration, density, requirements, parts)
        remedies = find_remedies(evaluation, grid, run)
        low, high = configuration.envelope.speed
        good = {speed: good_radii(evaluation, speed) for speed in (low, 0.5 * (low + high), high)}
        chart = run(run_job, columns) if pool is None else [job.result() for job in begun]
    return Design(
        evaluation, limits(evaluation), cautions(evaluation, chart), tuple(chart), good,
        tuple(remedies),
    )


def cautions(evaluation: Evaluation, chart: Iterable[ChartColumn]) -> tuple[Caution, ...]:
    """What the verdict does not count, but the flight warns of or the thesis advises against."""
    return tuple((*_flight_cautions(evaluation), *_chart_cautions(chart)))


def _flight_cautions(evaluation: Evaluation) -> Iterable[Caution]:
    configuration = evaluation.configuration
    warn = configuration.limits
    flown = [point for point in evaluation.points if point.state is not None]
    slow = [p for p in flown if p.stable and p.margin < warn.low_margin_per_s]
    if slow:
        least = min(slow, key=lambda point: point.margin)
        yield Caution(
            "LOW_MARGIN",
            f"{len(slow)} of {len(evaluation.points)} points have a margin below "
            f"limits.low_margin_per_s, {warn.low_margin_per_s:g} 1/s (least {least.margin:.3g} "
            f"1/s at {place(least)}): the flight will warn",
        )
    near = [p for p in flown if abs(p.nearest_jump) < warn.near_jump]
    if near:
        nearest = min(near, key=lambda point: abs(point.nearest_jump))
        yield Caution("NEAR_JUMP", f"the end mass jumps {jump_text(nearest)}")
    for way in evaluation.entries if evaluation.requirements.way_in == DEPLOYMENT else ():
        found = evaluation.way_in_violations(way)
        if found:
            names = ", ".join(criterion.value for criterion in found)
            where = "".join(f", jump at a tow radius of {j.radius:.4g} m" for j in way.jumps)
            yield Caution(
                "ENTRY",
                f"tightening from straight flight at {way.speed:.4g} m/s with all of the cable "
                f"out meets {names}{where}",
            )
    if not isfinite(configuration.cable.youngs_modulus):
        yield Caution(
            "INEXTENSIBLE",
            "cable.youngs_modulus is infinite: statics without stretch, vibration with the "
            "thesis's gamma of 600, whatever the cable is; margins may mislead",
        )
    if not isfinite(configuration.cable.breaking_tension):
        yield Caution(
            "TENSION_UNKNOWN", "cable.breaking_tension is not given: tension is not judged"
        )


def _chart_cautions(chart: Iterable[ChartColumn]) -> Iterable[Caution]:
    for column in chart:
        where = f"at a tow radius of {column.radius:.4g} m"
        if not column.above_cusp:
            yield Caution(
                "BELOW_CUSP",
                f"{where} omega falls to {column.omega[0]:.3g}, below the cusp's "
                f"{column.cusp.omega:.3g}: the design chart expects a wide circle of the end mass "
                "there, which a longer cable or more speed makes smaller",
            )
        if not column.enough_drag:
            required = column.critical.required
            yield Caution(
                "CABLE_DRAG",
                f"{where} d_n is {column.parameters.cable_drag:.3g}; at every omega up to "
                f"{column.omega_max:.3g} unique and stable solutions need "
                + (f"{required:.3g}" if isfinite(required) else "more than any"),
            )
        if column.note:
            yield Caution("CHART", f"{where} the design chart has gaps: {column.note}")
