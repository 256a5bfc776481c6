"""Steady state, motion in time and periodic motion beside MoorDyn: runs, comparisons, pictures."""
