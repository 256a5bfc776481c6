"""What the twin is off by, and costs, with fewer segments: the table of docs/twin.md.

    python test/twin_segments.py
"""

import time

import numpy as np
from test_twin import told

from ctcbs_ros.configuration import load_configuration
from ctcbs_ros.prediction.predictor import Predictor
from ctcbs_ros.simulated_flight import simulate_flight
from ctcbs_ros.twin.twin import Twin

SEGMENTS, FINE = (8, 12, 16, 24), 40
# Radius [m], speed [m/s], wind [m/s].
FLIGHTS = {"small_drone": (60.0, 18.0, (2.5, -1.5)), "design_example": (250.0, 50.0, (3.0, -2.0))}


class TimedTwin(Twin):
    """A twin that notes the processor time of each sample on an orbit [s]."""

    def __init__(self, configuration, segments):
        super().__init__(configuration, segments)
        self.spent = []

    def update(self, seen):
        begun = time.process_time()
        found = super().update(seen)
        if seen.orbit is not None:
            self.spent.append(time.process_time() - begun)
        return found


def flown(name: str, segments: int) -> tuple[np.ndarray, float]:
    """Where the twin has the end mass once valid, (n, 3), else nan; median seconds a sample."""
    radius, speed, wind = FLIGHTS[name]
    flight = simulate_flight(radius, speed, 3, wind=wind, rate=10.0)
    configuration = load_configuration(name)
    predictor = Predictor(configuration, with_twin=True)
    predictor._twin = twin = TimedTwin(configuration, segments)
    found = [predictor.update(s).simulated for s in told(flight, (1.5, 0.3), wind)]
    places = [f.position if f is not None and f.valid else np.full(3, np.nan) for f in found]
    return np.array(places), float(np.median(twin.spent))


def main() -> None:
    """Fly, compare, print."""
    for name, (radius, speed, wind) in FLIGHTS.items():
        print(f"{name}, {radius:g} m, {speed:g} m/s, wind {np.hypot(*wind):.1f} m/s")
        fine, _ = flown(name, FINE)
        for segments in SEGMENTS:
            places, spent = flown(name, segments)
            off = np.nanmax(np.linalg.norm(places - fine, axis=1)) / radius
            print(f"{segments:4d} segments: off {off:.1%} of the tow radius, "
                  f"{1e3 * spent:.1f} ms a sample")  # fmt: skip


if __name__ == "__main__":
    main()
