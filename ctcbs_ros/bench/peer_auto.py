"""Peer: AUTO-07p (Debian's package `auto-07p`) on the branch of the same cable.

The problem, `auto_cable.c`, is compiled and linked in a temporary folder, without AUTO's own
Python and make. Its time is AUTO's own "Total Time", its processor time is that of the process
less that of one which stops at the first point: start, compilation and linking do not count.
"""

import ctypes.util
import os
import re
import shutil
import statistics
import subprocess
import sys
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np

from ctcbs_ros.bench.timing import Measured, processor_time
from ctcbs_ros.solver.parameters import Parameters

AUTO = Path("/usr/lib/auto-07p")
# A mesh of 20 intervals with 4 collocation points each, its 80 steps measured along (omega,
# end-mass radius) and no longer than lets it see both folds; no diagnostics written.
CONSTANTS = """
NDIM=6, NBC=7, NINT=0, IPS=4, IRS=0, ILP=1, ISP=0, ISW=1, IPLT=0, ICP=[1,2], NPAR=6
NTST={intervals}, NCOL=4, IAD=3, JAC=0
NMX={points}, NPR=0, MXBF=0, IID=0, RL0=0.0, RL1={omega_max}, A0=-1e9, A1=1e9
EPSL=1e-7, EPSU=1e-7, EPSS=1e-6, ITMX=8, ITNW=8, NWTN=3
DS=0.02, DSMIN=1e-6, DSMAX=0.085, IADS=1
THL={{}}, THU={{1:0,2:0,3:0,4:0,5:0,6:0}}
"""
POINTS = 300
_FOLD = 5
_TIME_LIMIT = 60.0  # s


@dataclass(frozen=True)
class AutoBranch:
    """What AUTO found: omega and end-mass radius of the points, (n,), and of each fold."""

    omega: np.ndarray
    end_mass_radius: np.ndarray
    folds: tuple[tuple[float, float], ...]


class AutoProblem:
    """The problem, compiled and ready to be run.

    Parameters
    ----------
    folder : Path
        For the program and its files.
    parameters : Parameters
        Of the first point; inextensible, without buoyancy.
    end_mass_radius : float
        A steady state there.
    omega_max : float
    intervals : int
        Of the mesh.

    Raises
    ------
    FileNotFoundError
        If AUTO, a compiler or a Fortran runtime is not installed; the text says which.
    """

    def __init__(self, folder: Path, parameters: Parameters, end_mass_radius: float,
                 omega_max: float, intervals: int = 20):  # fmt: skip
        self._folder = folder
        self._constants = dict(omega_max=omega_max, intervals=intervals)
        _compile(folder, parameters, end_mass_radius)
        # Processor time of a run that only starts and ends.
        self._start = statistics.median(self._run(1)[0].cpu for _ in range(5))

    def run(self) -> Measured:
        """Compute the branch; wall time by AUTO's own clock, processor time less the start's."""
        measured, output = self._run(POINTS)
        total = re.search(r"Total Time\s+(\S+)", output)
        if total is None:
            raise ArithmeticError(f"AUTO-07p did not end well: {output[-300:]}")
        return Measured(float(total[1]), max(measured.cpu - self._start, 1e-6))

    def branch(self) -> AutoBranch:
        """The branch of the last run."""
        rows = []
        for line in (self._folder / "fort.7").read_text().splitlines():
            words = line.split()
            if words[0] != "0":
                # branch, point, type, label, omega, norm, maxima of u, end-mass radius
                rows.append((int(words[2]) % 10, float(words[4]), float(words[-1])))
        folds = tuple(row[1:] for row in rows if row[0] == _FOLD)
        _, omega, radius = np.array(rows).T
        return AutoBranch(omega, radius, folds)

    def _run(self, points: int) -> tuple[Measured, str]:
        (self._folder / "fort.2").write_text(CONSTANTS.format(points=points, **self._constants))
        (self._folder / "fort.3").write_text("")
        before = processor_time()
        done = subprocess.run(
            [str(self._folder / "cable")], cwd=self._folder, capture_output=True, text=True,
            env=os.environ | {"OMP_NUM_THREADS": "1"}, timeout=_TIME_LIMIT,
        )  # fmt: skip
        return Measured(0.0, processor_time() - before), done.stdout + done.stderr


def version() -> str:
    """AUTO's version by Debian's records; empty where they have none."""
    try:
        done = subprocess.run(
            ["dpkg-query", "-W", "-f", "${Version}", "auto-07p"], capture_output=True, text=True
        )
    except FileNotFoundError:
        return ""
    return done.stdout


def _compile(folder: Path, parameters: Parameters, end_mass_radius: float) -> None:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if not (AUTO / "lib" / "main.o").is_file():
        raise FileNotFoundError("AUTO-07p is not installed (Debian: auto-07p)")
    if compiler is None:
        raise FileNotFoundError("no C compiler for AUTO-07p")
    source = folder / "auto_cable.c"
    source.write_text(resources.files("ctcbs_ros.bench").joinpath(source.name).read_text())
    values = {
        "OMEGA": parameters.omega, "RADIUS": end_mass_radius, "LENGTH": parameters.length,
        "CABLE_DRAG": parameters.cable_drag, "DRAG_RATIO": parameters.drag_ratio,
        "END_MASS": parameters.end_mass,
    }  # fmt: skip
    library = AUTO / "lib"
    definitions = [f"-DSTART_{name}={value!r}" for name, value in values.items()]
    subprocess.run(
        [
            compiler, "-O2", *definitions, source.name,
            *map(str, sorted(library.glob("*.o"))), str(library / "libauto_c.a"),
            *_fortran_runtime(), "-fopenmp", "-lm", "-o", "cable",
        ],
        cwd=folder, check=True, capture_output=True,
    )  # fmt: skip


def _fortran_runtime() -> list[str]:
    """How to link libgfortran: gfortran's, the system's, or the one that numpy or scipy bring."""
    if gfortran := shutil.which("gfortran"):
        asked = subprocess.run(
            [gfortran, "-print-file-name=libgfortran.so"], capture_output=True, text=True
        )
        return [asked.stdout.strip()]
    if name := ctypes.util.find_library("gfortran"):
        return [f"-l:{name}"]
    for entry in sys.path:
        for library in sorted(Path(entry or ".").glob("*.libs/libgfortran*.so*")):
            return [str(library), f"-Wl,-rpath,{library.parent}"]
    raise FileNotFoundError("no Fortran runtime for AUTO-07p (Debian: gfortran)")
