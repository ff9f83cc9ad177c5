"""Pictures can be read: two numbers and a unit an axis, colours that a legend names, no text on a text or a curve.

The figures themselves are asked (``pictures.py``), drawn from rows made up to look like those computed.
"""

import numpy as np
import pytest
from matplotlib.figure import Figure
from pictures import faults
from rich.console import Console

from postprocess.style import picture
from wavetank.verify import growth, steepness
from wavetank.verify.report import Report


@pytest.fixture
def drawn(monkeypatch):
    """Return the figures that would have been saved."""
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path: figures.append(figure))
    return figures


@pytest.fixture
def report(tmp_path):
    return Report(tmp_path, Console(quiet=True))


def test_what_is_hard_to_read_is_found(drawn, tmp_path):
    """Each fault that the pictures had, in a figure that has them all."""
    with picture(tmp_path / "a.png", 4, 3) as figure:
        axes = figure.subplots()
        axes.loglog([1.1, 1.9], [1.2, 1.8], "-", color="#0072b2", label="one")
        axes.loglog([1.1, 1.9], [1.8, 1.2], "-", color="#d55e00")
        axes.set(xlabel="time [s]", ylabel="error")
        axes.legend(loc="center")
        axes.text(1.4, 1.25, "a text")
        axes.text(1.42, 1.25, "another")
        axes.minorticks_off()
    found = "\n".join(faults(figure))
    for fault in (
        "0 numbers at 'time [s]'",
        "no unit at 'error'",
        "no legend says what #d55e00 is",
        "the legend lies on",
        "'a text' lies on 'another'",
    ):
        assert fault in found


def test_steepness(drawn, report):
    rows = [
        steepness.Row(kd, height, 12, 6, "third-order", 40, 20, (1 + kd) * 1e-4 * height, 1e-4, 1e-5, 0.0, 1e-13, "")
        for kd in steepness.VERTICAL_ORDER
        for height in steepness.RESOLUTION
    ]
    steepness.draw(report, rows)
    (figure,) = drawn
    assert not faults(figure)
    phase, energy = figure.axes
    assert [axes.get_ylabel().rpartition(" ")[2] for axes in (phase, energy)] == ["[rad]", "[-]"]
    assert phase.lines[0].get_ydata() == pytest.approx([1.5e-4 * height for height in steepness.RESOLUTION])


def test_growth(drawn, report):
    rows = [
        growth.Row(*one, 20 * one.steepness**2 * one.p / 3, 100.0, max(0.0, 3 * one.steepness - 1), 1e-5)
        for one in growth.settings()
    ]
    growth.draw(report, rows)
    (figure,) = drawn
    assert not faults(figure)
    assert {len(line.get_xdata()) for line in figure.axes[0].lines} == {6}
    assert np.sum([len(line.get_xdata()) for line in figure.axes[1].lines[:-1]]) == 2 * len(rows)
