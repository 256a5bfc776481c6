"""A whole design evaluated: every point of the envelope and every way in."""

from dataclasses import dataclass
from itertools import chain

from ctcbs_ros.configuration import Configuration
from ctcbs_ros.design.envelope import closer_look, envelope_row, grid_lines
from ctcbs_ros.design.point import DesignPoint
from ctcbs_ros.design.requirements import Criterion, Requirements, violations
from ctcbs_ros.design.way_in import DEPLOYMENT, ENTRY, WayIn, deploy, enter


@dataclass(frozen=True)
class Grid:
    """Numbers of tow radii and speeds; of those with a way in; of points on each way in."""

    radii: int = 17
    speeds: int = 9
    deployed_radii: int = 5
    deployed_speeds: int = 3
    steps: int = 32


@dataclass(frozen=True)
class Evaluation:
    """A configuration with all that was computed of it, and what it is measured against.

    Attributes
    ----------
    configuration : Configuration
    density : float
        Of the air [kg/m^3].
    requirements : Requirements
    rows : tuple of tuple of DesignPoint
        The envelope's grid: a row for each tow radius, rising, of rising speeds.
    closer : tuple of DesignPoint
        Around the worst points of the grid.
    ways_in : tuple of WayIn
        Deployments and entries; those of `Requirements.way_in` count.
    """

    configuration: Configuration
    density: float
    requirements: Requirements
    rows: tuple[tuple[DesignPoint, ...], ...]
    closer: tuple[DesignPoint, ...]
    ways_in: tuple[WayIn, ...]

    @property
    def points(self) -> tuple[DesignPoint, ...]:
        """All points of the envelope."""
        return (*chain.from_iterable(self.rows), *self.closer)

    @property
    def deployments(self) -> tuple[WayIn, ...]:
        """The ways in by paying out on the circle."""
        return tuple(way for way in self.ways_in if way.kind == DEPLOYMENT)

    @property
    def entries(self) -> tuple[WayIn, ...]:
        """The ways in by tightening from straight flight."""
        return tuple(way for way in self.ways_in if way.kind == ENTRY)

    @property
    def judged_ways_in(self) -> tuple[WayIn, ...]:
        """Those that count."""
        return tuple(way for way in self.ways_in if way.kind == self.requirements.way_in)

    def violations(self, point: DesignPoint, paid_out: bool = True) -> tuple[Criterion, ...]:
        """What a point does not meet."""
        return violations(point, self.configuration, self.requirements, paid_out)

    def way_in_violations(self, way: WayIn) -> tuple[Criterion, ...]:
        """What a way in does not meet at any of its points, or between them."""
        found = [c for point in way.points for c in self.violations(point, False)]
        if way.jumps:
            found.append(Criterion.JUMPED)
        if any(not change.becomes_stable for change in way.changes):
            found.append(Criterion.UNSTABLE)
        return tuple(criterion for criterion in Criterion if criterion in found)

    @property
    def envelope_good(self) -> bool:
        """Whether every point of the envelope meets every requirement."""
        return not any(self.violations(point) for point in self.points)

    @property
    def entries_good(self) -> bool:
        """Whether every way in from straight flight does."""
        return not any(self.way_in_violations(way) for way in self.entries)

    @property
    def good(self) -> bool:
        """The verdict: the envelope, and the ways in that count."""
        return self.envelope_good and not any(
            self.way_in_violations(way) for way in self.judged_ways_in
        )


def evaluate(
    configuration: Configuration,
    density: float,
    requirements: Requirements,
    grid: Grid | None = None,
) -> Evaluation:
    """Evaluate a design.

    Parameters
    ----------
    configuration : Configuration
    density : float
        Of the air [kg/m^3].
    requirements : Requirements
    grid : Grid, optional

    Returns
    -------
    Evaluation
    """
    jobs = evaluation_jobs(configuration, density, requirements, grid or Grid())
    return assemble(configuration, density, requirements, list(map(run_job, jobs)))


def evaluation_jobs(
    configuration: Configuration, density: float, requirements: Requirements, grid: Grid
) -> list[tuple]:
    """The independent parts of an evaluation, each for `run_job`."""
    low, high = configuration.envelope.radius
    radii = grid_lines((low, high), grid.radii)
    speeds = grid_lines(configuration.envelope.speed, grid.speeds)
    few = grid_lines(configuration.envelope.speed, grid.deployed_speeds)
    jobs = [(envelope_row, configuration, density, a, speeds) for a in radii]
    jobs += [(enter, configuration, density, low, v, grid.steps) for v in few]
    if requirements.way_in == DEPLOYMENT:
        jobs += [
            (deploy, configuration, density, a, v, grid.steps)
            for a in grid_lines((low, high), grid.deployed_radii)
            for v in few
        ]
    return jobs


def run_job(job: tuple):
    """Do one part."""
    function, *arguments = job
    return function(*arguments)


def assemble(
    configuration: Configuration, density: float, requirements: Requirements, parts: list
) -> Evaluation:
    """Put the parts of an evaluation together, and look closer where it is worst."""
    rows = tuple(part for part in parts if isinstance(part, tuple))
    return Evaluation(
        configuration,
        density,
        requirements,
        rows,
        closer_look(configuration, density, rows),
        tuple(part for part in parts if isinstance(part, WayIn)),
    )
