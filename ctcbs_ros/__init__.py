"""Prediction of the end mass of a cable towed by a circling aircraft.

The way data flows, one stage a room, one value object between each two (docs/architecture.md):

    telemetry.Sample -> orbit.Orbit -> solver.Parameters -> table, Newton -> prediction.Prediction
"""

import os

# The matrices here are small (up to some 200 rows): a second BLAS thread only costs time, most of
# all beside other work. Effective where numpy has not been imported before; the user's own setting
# stands.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__version__ = "0.1.0"
