"""Steady states, their stability and their folds, in non-dimensional parameters."""
