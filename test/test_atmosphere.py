"""The standard atmosphere against its published tables."""

from math import inf, isnan, nan

import pytest

from ctcbs_ros.atmosphere import standard_atmosphere_density

# U.S. Standard Atmosphere, 1976 (NASA-TM-X-74335), Table I: geometric altitude [m], density
# [kg/m^3]. Identical with ICAO Doc 7488 up to 32 km.
TABLE = [
    (-1000.0, 1.3470),
    (0.0, 1.2250),
    (1000.0, 1.1117),
    (2000.0, 1.0066),
    (5000.0, 0.73643),
    (10_000.0, 0.41351),
    (11_000.0, 0.36480),
    (15_000.0, 0.19476),
    (20_000.0, 0.088910),
]


@pytest.mark.parametrize(("altitude", "density"), TABLE)
def test_density_is_that_of_the_published_table(altitude, density):
    assert standard_atmosphere_density(altitude) == pytest.approx(density, rel=5e-5)


def test_density_is_continuous_across_the_tropopause():
    # geopotential 11 km lies at geometric 11019.07 m
    below, above = (standard_atmosphere_density(11_019.07 + step) for step in (-0.01, 0.01))
    assert below == pytest.approx(above, rel=1e-5)
    assert below > above


@pytest.mark.parametrize("altitude", [-6000.0, 21_000.0, inf, -inf, nan, -6_356_766.0])
def test_density_outside_the_layers_is_not_a_number(altitude):
    assert isnan(standard_atmosphere_density(altitude))
