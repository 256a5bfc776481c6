"""Prediction of the end mass of a cable towed by a circling aircraft.

The way data flows, one stage a room, one value object between each two (docs/architecture.md):

    telemetry.Sample -> orbit.Orbit -> solver.Parameters -> table, Newton -> prediction.Prediction
"""

__version__ = "0.1.0"
