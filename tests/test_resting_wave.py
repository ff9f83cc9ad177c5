"""Exact standing waves against Stokes' expansion of them, and in the tank against themselves."""

from functools import lru_cache

import numpy as np
import pytest
from conftest import fitted_slope

from examples.paper import standing
from examples.paper.resting_wave import resting_wave
from examples.paper.standing_wave import ThirdOrderStandingWave
from wavetank.base.errors import InputError

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
def test_a_wave_too_high_to_be_found_begins_as_lower_ones_suggest(monkeypatch):
    """Oracle: the exact wave, which can be had of that height; 2e-3 of it are missed, of third order."""
    monkeypatch.setattr(standing, "HIGHEST", 0.02)
    monkeypatch.setattr(standing, "LOWER", (0.01, 0.015, 0.02))
    monkeypatch.setattr(standing, "at_rest", lru_cache(standing.at_rest.__wrapped__))
    found = standing.at_rest(0.03)
    exact = resting_wave(0.03 * standing.LENGTH, standing.LENGTH, depth=standing.DEPTH)
    x = np.linspace(0.0, standing.LENGTH / 2, 21)
    assert found.period == pytest.approx(exact.period, rel=1e-6)
    assert np.abs(found.elevation(x) - exact.elevation(x)).max() < 1e-4


@pytest.mark.slow
def test_a_steep_standing_wave_comes_back_for_ten_periods():
    """Of a tenth of its length; at its crest the water is thrown up at rest, where a cosine would have jets."""
    found = standing.released(0.10, "simpson-4").row
    assert found.shape_error < 1e-4 and abs(found.height_change) < 1e-4
    assert abs(found.energy_change + found.dissipated) < 1e-8
