"""Pictures can be read: two numbers and a unit an axis, colours that a legend names, no text on a text or a curve.

The figures themselves are asked (``pictures.py``), drawn from rows made up to look like those computed.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pictures import faults
from rich.console import Console

from examples.paper.report import Report
from wavetank.plots.style import picture
from wavetank.studies.drawing import WARNED, draw_responses, draw_trade
from wavetank.studies.measures import GAUGE_ERROR, PHASE_ERROR, SURFACE_ERROR
from wavetank.studies.responses import CREST, CREST_PLACE, TROUGH
from wavetank.studies.sweep import combinations, parse_axes
from wavetank.studies.table import Row, StudyTable

CASES = Path(__file__).resolve().parents[1] / "cases"


@pytest.fixture
def report(tmp_path):
    return Report(tmp_path, Console(quiet=True))


def test_faults_of_pictures_are_detected(drawn, tmp_path):
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
        "the legend lies on a curve",
        "'a text' lies on 'another'",
    ):
        assert fault in found


# ---------------------------------------------------------------- studies
def study_table(case, sweeps, measures):
    """Return the table of a study; errors, responses and costs of a run are a function of the settings."""
    axes = parse_axes(sweeps)
    found, _ = combinations(CASES / case, axes)
    rows = [Row(one.values, "finished", "", *measures(n, one.values)) for n, one in enumerate(found)]
    return StudyTable(rows, axes, found[0].scene)


def opened(panel):
    """Return where a panel has open marks."""
    white = [line for line in panel.lines if line.get_markerfacecolor() == "white"]
    return [list(place) for line in white for place in line.get_xydata()]


def told(figure):
    """Return what the figure's legends say."""
    return {text.get_text() for legend in figure.legends for text in legend.get_texts()}


def test_trade_labels_the_pareto_front_and_opens_marks_of_warnings(drawn, tmp_path):
    """As the steep ring's: numbers on axes of less than a decade, each point of the front named, no name on another."""
    steps = ("0.055875", "0.0279375", "0.01396875")
    sizes = {"third-order": (2.6e-4, 1.2e-4, 1.19e-4), "simpson-4": (2e-4, 1.18e-4, 1.17e-4)}

    def measures(n, values):
        error = sizes[values["integrator"]][steps.index(values["dt"])]
        return {SURFACE_ERROR: error, GAUGE_ERROR: 1.1 * error}, {}, {"CPU [s]": 50 + 0.4 / float(values["dt"]) + n}

    sweeps = [f"dt={','.join(steps)}", f"integrator={','.join(sizes)}"]
    table = study_table("ring-50-percent.toml", sweeps, measures)
    rows = table.rows
    rows[1] = rows[1]._replace(warnings="it breaks")
    broken = rows[1]._replace(status="broke down", errors={}, costs={})
    draw_trade(replace(table, rows=[broken, *rows]), tmp_path / "study.png")
    (figure,) = drawn
    assert not faults(figure)
    point = [rows[1].costs["CPU [s]"], rows[1].errors[SURFACE_ERROR]]
    assert opened(figure.axes[0]) == [point] and {WARNED, "broke down: 1 of 7 runs"} <= told(figure)
    for panel in figure.axes:
        assert len(panel.texts) > 2
        assert {text.get_text() for text in panel.texts} <= {f"{float(step):.3g}" for step in steps}


def test_study_of_a_physical_key_draws_responses_over_it(drawn, tmp_path):
    """No front and no CPU time: crests over heights, in metres both, a line for each vertical order; errors beside.

    Where no run has finished stands a cross on the axis.
    """

    def measures(n, values):
        a = float(values["initial.wave_amplitude"])
        return {SURFACE_ERROR: a / 10, PHASE_ERROR: -a}, {CREST: 1.2 * a, TROUGH: -0.9 * a, CREST_PLACE: 2.0}

    sweeps = ["initial.wave_amplitude=0.01,0.04,0.02", "n=4,6"]
    table = study_table("standing-wave.toml", sweeps, measures)
    rows = table.rows
    rows[2], marked = (rows[n]._replace(warnings="it breaks", mark=mark) for n, mark in ((2, ""), (1, "plan")))
    axes = parse_axes([f"{sweeps[0]},0.08", sweeps[1]])
    highest = [{"initial.wave_amplitude": "0.08", "n": n} for n in ("4", "6")]
    ended = [Row(values, "broke down", warnings="it breaks") for values in highest]
    rows[3] = rows[3]._replace(broke=15)
    draw_responses(replace(table, rows=[*ended, *rows, marked], axes=axes), tmp_path / "study.png")
    (figure,) = drawn
    assert not faults(figure)
    crests = [[a, 1.2 * a] for a in (0.04, 0.01)]  # of the run that is swept, and of the star
    np.testing.assert_allclose(opened(figure.axes[0]), crests)
    labels = {panel.get_ylabel() for panel in figure.axes if panel.axison}
    assert labels == {CREST, TROUGH, CREST_PLACE, SURFACE_ERROR, PHASE_ERROR}
    for panel in (panel for panel in figure.axes if panel.axison):
        assert {place for line in panel.lines if line.get_marker() == "x" for place in line.get_xdata()} == {0.08}
        assert panel.get_xlim()[1] > 0.08
    assert {panel.get_xlabel() for panel in figure.axes if panel.axison} == {"initial.wave_amplitude [m]"}
    of_runs = {WARNED, "broke down: 2 of 9 runs", "waves broke and were damped: 1 of 9 runs"}
    assert told(figure) == {"n = 4", "n = 6", "plan: initial.wave_amplitude 0.01, n 6", *of_runs}
    crest = figure.axes[0].lines[0]
    np.testing.assert_allclose(crest.get_xydata(), [(a, 1.2 * a) for a in (0.01, 0.02, 0.04)])


def test_study_of_a_physical_key_without_numbers_names_its_values(drawn, tmp_path):
    def measures(n, values):
        return {SURFACE_ERROR: 0.1}, {CREST: 0.1 + n, TROUGH: -0.1, CREST_PLACE: 0.0}

    table = study_table("standing-wave.toml", ["water.type=linear,nonlinear"], measures)
    table.rows.append(Row(table.rows[1].values, "broke down", warnings="it breaks"))  # its warning is of no mark
    draw_responses(table, tmp_path / "study.png")
    (figure,) = drawn
    assert not faults(figure)
    assert not opened(figure.axes[0]) and WARNED not in told(figure)
    assert len([panel for panel in figure.axes if panel.lines]) == 3  # without a sweep of numerics no errors
    assert [label.get_text() for label in figure.axes[0].get_xticklabels()] == ["linear", "nonlinear"]
