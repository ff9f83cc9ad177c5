"""Diffraction by a vertical circular cylinder in a basin against McCamy and Fuchs' theory of small waves.

The recipe, and how far a closed basin and two periods of waiting let it get (some 0.4 % of the incident amplitude):
``examples/paper/mccamy_fuchs.py``; the basin is that of ``examples/paper/cylinder.py``.
"""

import numpy as np
import pytest
from conftest import fitted_slope

from examples.paper.cylinder import ANGLES, HalfBasin


@pytest.mark.parametrize("ka", [pytest.param(0.5, marks=pytest.mark.slow), 1.0])
def test_the_run_up_is_that_of_mccamy_and_fuchs(ka):
    """Everywhere around the cylinder to 1 % of the incident amplitude, which it exceeds by three quarters in front."""
    basin = HalfBasin(ka, 0.35, order=3)
    run_up = basin.linear()
    assert basin.error(run_up) < 0.01
    assert ANGLES[run_up.argmax()] > 0.9 * np.pi and np.ptp(run_up) > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("ka", [0.5, 1.0, 2.0])
def test_it_converges_over_three_refinements(ka):
    """At least with the order of the elements, down to the recipe's own error, some 0.4 %."""
    sizes = (0.35, 0.25, 0.18, 0.125)
    errors = [(basin := HalfBasin(ka, size, order=2)).error(basin.linear()) for size in sizes]
    assert fitted_slope(sizes, errors) > 1.9
    basin = HalfBasin(ka, 0.18, order=3)
    assert basin.error(basin.linear()) < 0.0075


@pytest.mark.slow
def test_nonlinear_waves_of_small_amplitude_run_up_alike():
    basin = HalfBasin(1.0, 0.35, order=3)
    assert basin.error(basin.nonlinear()) < 0.01


# ---------------------------------------------------------------- in a scene
