"""What the rows of one run share: a folder, the configurations, a table, a simulated flight."""

import tempfile
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from ctcbs_ros.configuration import Configuration, load_configuration
from ctcbs_ros.solver.parameters import Parameters
from ctcbs_ros.table import table_for
from ctcbs_ros.table.storage import save_table
from ctcbs_ros.table.table import Table

# In the middle of the small drone's envelope, with the noise of a good receiver.
_FLIGHT = dict(radius=60.0, speed=20.0, turns=6, radius_change=(80.0, 3.0), height=250.0)
_NOISE = dict(position_noise=1.5, velocity_noise=0.3, seed=1)


@dataclass
class Session:
    """One run.

    Attributes
    ----------
    quick : bool
        Fewer rounds.
    points : int
        Random points for the search of all states.
    starts : list
        Starts of the node and of its peer, which two rows are about.
    """

    quick: bool = False
    points: int = 40
    starts: list = field(default_factory=list)
    _folder: tempfile.TemporaryDirectory = field(
        default_factory=lambda: tempfile.TemporaryDirectory(prefix="ctcbs_bench_")
    )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._folder.cleanup()

    @property
    def folder(self) -> Path:
        """A folder that goes with the run."""
        return Path(self._folder.name)

    def rounds(self, full: int) -> int:
        """Number of rounds of a row that has `full` of them."""
        return max(full // 4, 3) if self.quick else full

    @cached_property
    def drone(self) -> Configuration:
        """The default configuration."""
        return load_configuration("small_drone")

    @cached_property
    def design(self) -> Parameters:
        """The thesis's design example at its largest radius, elastic."""
        from ctcbs_ros.scaling import flight_point

        example = load_configuration("design_example")
        radius, speed = example.envelope.radius[1], sum(example.envelope.speed) / 2
        return flight_point(example, radius, speed, example.air.density_at(0.0)).parameters

    @cached_property
    def table(self) -> Table:
        """The default configuration's table; from the cache unless this run has built one."""
        return table_for(self.drone)

    @cached_property
    def table_file(self) -> Path:
        """File of the table."""
        file = self.folder / "table.npz"
        save_table(self.table, self.drone, file)
        return file

    @cached_property
    def log(self) -> Path:
        """Log of a simulated flight."""
        from ctcbs_ros.simulate import simulate_flight, write_tlog

        flight = simulate_flight(**_FLIGHT)
        write_tlog(
            self.folder / "flight.tlog", flight, latitude=47.0, longitude=8.0, **_NOISE
        )
        return self.folder / "flight.tlog"
