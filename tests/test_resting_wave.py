"""Exact standing waves against Stokes' expansion of them, and in the tank against themselves."""

import numpy as np
import pytest
from conftest import fitted_slope

from wavetank.errors import InputError
from wavetank.theory.resting_wave import resting_wave
from wavetank.theory.standing_wave import ThirdOrderStandingWave
from wavetank.verify.standing import released

LENGTH, DEPTH = 2.0, 0.6


def of_third_order(height: float) -> ThirdOrderStandingWave:
    """Return Stokes' wave of that height, crest above trough at rest: its amplitude is that of the first cosine."""
    amplitude = height / 2
    for _ in range(20):
        wave = ThirdOrderStandingWave(amplitude=amplitude, length=LENGTH / 2, depth=DEPTH)
        ends = wave.elevation([0.0, LENGTH / 2])
        amplitude *= height / (ends[0] - ends[1])
    return wave


def test_low_waves_are_those_of_the_expansion_to_third_order():
    """The surface differs by the fourth order in the height, the frequency, of even powers only, by that too."""
    heights, x = [0.02, 0.04, 0.06], np.linspace(0.0, LENGTH / 2, 41)
    surfaces, periods = [], []
    for height in heights:
        wave, series = resting_wave(height, LENGTH, depth=DEPTH), of_third_order(height)
        surfaces.append(np.abs(wave.elevation(x) - series.elevation(x)).max())
        periods.append(abs(wave.period * series.frequency / (2 * np.pi) - 1))
    assert fitted_slope(heights, surfaces) == pytest.approx(4, abs=0.3)
    assert fitted_slope(heights, periods) == pytest.approx(4, abs=0.3) and periods[0] < 1e-6


@pytest.mark.parametrize("height", [0.0, -0.1, 0.31])
def test_a_height_that_is_not_offered_is_refused(height):
    with pytest.raises(InputError, match=rf"height = {height:g} m: must be above 0 and at most 0\.3 m"):
        resting_wave(height, LENGTH, depth=DEPTH)


@pytest.mark.slow
def test_a_steep_standing_wave_comes_back_for_ten_periods():
    """Of a tenth of its length; at its crest the water is thrown up at rest, where a cosine would have jets."""
    found = released(0.10, "simpson-4").row
    assert found.shape_error < 1e-4 and abs(found.height_change) < 1e-4
    assert abs(found.energy_change + found.dissipated) < 1e-8
