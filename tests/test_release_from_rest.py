"""Nonlinear sloshing against an independent computation: conformal mapping, Fourier spectral, accurate to 1e-9 m."""

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import fitted_slope
from tanks import executed

REFERENCE = Path(__file__).resolve().parents[2] / "shared" / "data" / "release_from_rest_reference"


CASES = ("sloshing_deep_kd3.14_ak0.1", "sloshing_inter_kd1_ak0.1")
SAMPLES = 40  # of the reference, per linear period


def largest_error(case: str, *, cells: int, order: int, n: int, steps: int) -> float:
    """Return the largest difference to the reference at its gauges in a period [m]; ``steps`` are between samples."""
    if not REFERENCE.is_dir():
        pytest.skip("the reference computation is not on this machine")
    facts = json.loads((REFERENCE / f"{case}.json").read_text())
    reference = np.loadtxt(REFERENCE / f"{case}.csv", delimiter=",", skiprows=1)[: SAMPLES + 1]
    dt = float(reference[1, 0]) / steps
    numerics = {"cells": cells, "order": order, "vertical_order": n, "dt": dt, "tolerance": 1e-11}
    parts = {"tank": {"length": facts["tank_length"], "depth": facts["depth"]}, "gauges": facts["probes"]}
    parts |= {"initial": {"type": "standing-wave", "wave_amplitude": facts["a"]}, "output": {"gauges_every": steps}}
    *_, rows, _ = executed({**parts, "run": {"duration": SAMPLES * steps * dt}, "numerics": numerics})
    return float(np.abs(rows[:, 1:] - reference[:, 1:]).max())


@pytest.mark.parametrize("case", [CASES[0], pytest.param(CASES[1], marks=pytest.mark.slow)])
def test_elevation_converges_in_cell_size(case):
    """Between p and p + 1 for p = 3: without dissipation, odd orders may lose one in the transport terms."""
    cells = (8, 24)
    errors = [largest_error(case, cells=count, order=3, n=8, steps=4) for count in cells]
    assert 3 - 0.3 < -fitted_slope(cells, errors) < 4 + 0.5
    assert errors[-1] < 1e-6  # a micrometre of 3 cm


def test_elevation_converges_in_time_with_fourth_order():
    """Down to some nanometres, which are the reference's and the mesh's."""
    steps = (2, 4)
    errors = [largest_error(CASES[1], cells=4, order=8, n=6, steps=count) for count in steps]
    assert -fitted_slope(steps, errors) == pytest.approx(4, abs=0.25)


@pytest.mark.parametrize(
    ("case", "orders"), [pytest.param(CASES[0], (2, 4, 6), marks=pytest.mark.slow), (CASES[1], (2, 3, 4))]
)
def test_elevation_converges_spectrally_in_the_vertical_order(case, orders):
    """The slope against log n steepens: faster than any power."""
    errors = [largest_error(case, cells=8, order=4, n=n, steps=3) for n in orders]
    slopes = np.diff(np.log(errors)) / np.diff(np.log(orders))
    assert slopes[1] < slopes[0] < -3.0
