"""Readers of telemetry (MAVLink and DataFlash) and the screening of what they yield."""
