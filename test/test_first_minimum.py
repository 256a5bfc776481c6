"""The first minimum of the end-mass radius over omega."""

from dataclasses import replace

import pytest
from scans import FIG_31

from ctcbs_ros.solver.first_minimum import first_minimum_state


def test_a_minimum_beyond_the_limit_is_not_reported_at_the_limit():
    # The minimum lies at omega 10.1.
    parameters = replace(FIG_31, length=2.0, cable_drag=51.5)
    assert first_minimum_state(parameters) is None
    assert first_minimum_state(parameters, 20.0).parameters.omega == pytest.approx(10.14, abs=0.01)
