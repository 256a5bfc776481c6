"""From telemetry samples to the circle that is flown."""
