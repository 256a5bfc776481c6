"""Loci of steady states in two parameters, under one name.

`fold_curve` follows folds and `hopf_curve` the onset of flutter in (omega, cable drag); `cusp`
finds where folds are born, `critical_drag` the least drag for unique and for stable solutions.
"""

from ctcbs_ros.solver.critical_drag import CriticalDrag, critical_drag, first_minimum_state
from ctcbs_ros.solver.cusp import OMEGA_MAX, cusp, has_folds, least_unique_drag
from ctcbs_ros.solver.fold_curve import FoldCurve, fold_curves
from ctcbs_ros.solver.fold_curve import LocusPoint as Cusp
from ctcbs_ros.solver.hopf_curve import HopfCurve, hopf_curves

__all__ = [
    "OMEGA_MAX", "CriticalDrag", "Cusp", "FoldCurve", "HopfCurve", "critical_drag", "cusp",
    "first_minimum_state", "fold_curves", "has_folds", "hopf_curves", "least_unique_drag",
]
