"""Compiled kernels on plain floats and arrays: no classes, no input or output."""
