"""Studies of physics: responses of known waves by name and formula, ensembles of seeds, and the pictures of studies."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from conftest import CHECKOUT
from hypothesis import given
from hypothesis import strategies as st
from pictures import faults
from records import csv_rows, gauge_array, surface, write_run
from scipy import stats
from xarray import Dataset

from wavetank.case.reading import read_case
from wavetank.studies import responses
from wavetank.studies.drawing import WARNING_LABEL, draw_ensembles, draw_responses, draw_trade, pareto_front
from wavetank.studies.measures import GAUGE_ERROR, PHASE_ERROR, SURFACE_ERROR
from wavetank.studies.responses import CREST, CREST_PLACE, QUANTITIES, TROUGH
from wavetank.studies.sweep import Axis, combinations, marked_combination, parse_axes
from wavetank.studies.table import Row, StudyTable, ensembles
from wavetank.waves.airy import wave_number

CASES = CHECKOUT / "cases"
CASE = CASES / "wavemaker.toml"
OMEGA = np.pi
K = float(wave_number(OMEGA, 1.0, 9.81))


def eta(x, t):
    """Return regular waves of 5 cm, of which a tenth comes back, with a second harmonic; still before t = 8 s."""
    waves = 0.05 * np.cos(K * x - OMEGA * t) + 0.005 * np.cos(K * x + OMEGA * t) + 0.004 * np.cos(2 * OMEGA * t)
    return waves * (t >= 8.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run directory with these waves."""
    case, x, t = read_case(CASE), np.linspace(0, 40, 401), np.arange(0, 24, 0.05)
    names, places = zip(*((gauge.name, gauge.x) for gauge in case.all_gauges), strict=True)
    record = gauge_array(names, places, [0.0] * len(places), t, [eta(at, t) for at in places])
    path = tmp_path_factory.mktemp("runs") / "run"
    return write_run(path, case, gauges=record, surface=surface(t, x, eta(x, t[:, None])))


def of(run, *texts, start=8.0):
    told, causes = responses.evaluate_responses(run, [responses.parse_response(text) for text in texts], start=start)
    assert not causes, causes
    return list(told.values())


def test_responses_are_those_of_the_waves(run):
    """Oracle: the waves that the run was made of, from 8 s on."""
    first = 0.05 * abs(1 + 0.1 * np.exp(-2j * K * 5.0))
    a1, a2, ratio, reflection, run_up = of(run, "a1@1", "a2@1", "second=a2@1/a1@1", "reflection", "run_up")
    assert (a1, a2, ratio) == pytest.approx((first, 0.004, 0.004 / first), rel=1e-4)
    assert reflection == pytest.approx(0.1, rel=1e-3)  # its period is the paddle's, as the case says
    late = np.arange(8, 24, 0.05)
    assert run_up == pytest.approx(eta(40.0, late).max())
    hm0, crest, trough = of(run, "hm0@2", "crest@3", "trough@3")
    assert hm0 == pytest.approx(4 * np.std(eta(10.0, late)), rel=1e-6)
    assert (crest, trough) == pytest.approx((eta(15.0, late).max(), eta(15.0, late).min()))
    highest, where, when, lowest = responses.evaluate_responses(run, responses.usual_responses(read_case(CASE)))[
        0
    ].values()
    assert highest == pytest.approx(eta(where, when)) and lowest < 0 < highest


@pytest.mark.parametrize("key", [key for key in QUANTITIES if not key.endswith("@LOAD")])
def test_every_quantity_is_a_number_with_its_unit(run, key):
    name = key.replace("GAUGE", "2")
    (value,) = of(run, name)
    assert np.isfinite(value) and responses.parse_response(name).label == f"{name} [{QUANTITIES[key].unit}]"


def test_formulae_name_their_columns():
    assert responses.parse_response("transmission [-] = hm0@2 / hm0@1").label == "transmission [-]"
    formula = "sqrt(crest@1**2 + 1e-3) - 0.5*pi*hm0@'a b'"
    assert responses.parse_response(formula).label == formula
    assert [name for _, name in responses.parse_response("max(hm0@A.3, crest) - hm0@'a b'").quantities] == [
        "A.3",
        "",
        "a b",
    ]


def test_response_that_a_run_does_not_contain_is_an_empty_cell_with_a_cause(run, tmp_path):
    told, causes = responses.evaluate_responses(
        run, [responses.parse_response("h_max@1"), responses.parse_response("crest")], start=23.5
    )
    assert list(told) == ["h_max@1 [m]", "crest [m]"] and np.isnan(told["h_max@1 [m]"]) and len(causes) == 1
    assert causes[0].startswith("h_max@1 [m]: gauge 1: 0 whole waves")
    row = Row({"tank.depth": "1.0"}, "finished", responses=told | {"crest [m]": 0.1})
    StudyTable([row], [Axis("tank.depth", ("1.0",))], read_case(CASE)).write(tmp_path / "study.csv")
    (table,) = csv_rows(tmp_path / "study.csv")
    assert (table["h_max@1 [m]"], table["crest [m]"]) == ("", "0.1")


# ---------------------------------------------------------------- ensembles
def ensemble(seeds, settings, response):
    """Return the table of a study of seeds, with a response of the settings and the seed."""
    axes, rows = [Axis(key, tuple(values)) for key, values in settings.items()], []
    for *values, seed in product(*settings.values(), range(seeds)):
        named = dict(zip(settings, values, strict=True)) | {"wall.motion.seed": str(seed)}
        rows.append(Row(named, "finished", responses={"hm0 [m]": response(named), "crest [m]": 0.1 * seed}))
    axes.append(Axis("wall.motion.seed", tuple(map(str, range(seeds)))))
    return StudyTable(rows, axes, read_case(CASE, ["title=A sea"]))


def test_ensemble_has_mean_confidence_and_quantiles():
    """Oracle: scipy.stats' t interval, numpy's quantiles; settings apart, without failed and marked runs."""
    rng = np.random.default_rng(1)
    table = ensemble(9, {"tank.depth": ["1", "2"]}, lambda named: float(named["tank.depth"]) + rng.normal())
    table.rows[3] = table.rows[3]._replace(responses={})
    found = ensembles(replace(table, rows=[*table.rows, table.rows[0]._replace(mark="plan")]))
    names = ["tank.depth", "response", "runs"]
    expected = [(depth, name, runs) for name in ("hm0 [m]", "crest [m]") for depth, runs in (("1", 8), ("2", 9))]
    assert [*found[names].itertuples(index=False, name=None)] == expected
    for _, one in found.iterrows():
        rows = [row for row in table.rows if row.values["tank.depth"] == one["tank.depth"] and row.responses]
        values = [row.responses[one["response"]] for row in rows]
        interval = stats.t.interval(0.95, len(values) - 1, one["mean"], stats.sem(values))
        assert (one["mean from"], one["mean to"]) == pytest.approx(interval)
        assert [*one[["5 %", "50 %", "95 %"]]] == pytest.approx(np.quantile(values, (0.05, 0.5, 0.95)))
        assert one["standard deviation"] == pytest.approx(np.std(values, ddof=1))


# ---------------------------------------------------------------- pictures, of rows that look like computed ones
def study_table(case, sweeps, measures):
    """Return the table of a study; errors, responses and costs of a run are a function of the settings."""
    axes = parse_axes(sweeps)
    found, _ = combinations(CASES / case, axes)
    rows = [Row(one.values, "finished", "", *measures(n, one.values)) for n, one in enumerate(found)]
    return StudyTable(rows, axes, found[0].case)


def opened(panel):
    """Return where a panel has open marks."""
    white = [line for line in panel.lines if line.get_markerfacecolor() == "white"]
    return [list(place) for line in white for place in line.get_xydata()]


def legend(figure):
    return {text.get_text() for one in figure.legends for text in one.get_texts()}


@pytest.mark.parametrize("settings", [{}, {"tank.depth": ["1", "2", "4"]}, {"water.type": ["linear", "nonlinear"]}])
def test_ensembles_are_drawn(drawn, tmp_path, settings):
    rng = np.random.default_rng(1)
    table = ensemble(9, settings, lambda named: 1 + 0.1 * rng.normal())
    table.rows[4:7:2] = table.rows[4]._replace(warnings="it breaks"), table.rows[6]._replace(responses={})
    draw_ensembles(table, ensembles(table), tmp_path / "study.png")
    (figure,) = drawn
    assert [height for _, height in opened(figure.axes[1])] == [0.4]
    assert figure.legends[0].get_texts()[-1].get_text() == WARNING_LABEL
    assert not faults(figure) and {panel.get_ylabel() for panel in figure.axes} == {"hm0 [m]", "crest [m]"}


@given(st.lists(st.tuples(st.integers(1, 20), st.integers(1, 20)), min_size=1))
def test_no_point_dominates_the_pareto_front(points):
    """Oracle: the definition, pair by pair."""
    x, y = np.array(points).T
    front = [*pareto_front(Dataset({"x": ("run", x), "y": ("run", y)}).to_dataframe()).itertuples(False, None)]

    def beaten(one):
        return any(other != one and other[0] <= one[0] and other[1] <= one[1] for other in points)

    assert front == sorted({point for point in points if not beaten(point)})


def test_trade_names_axes_units_settings_front_and_plan(tmp_path):
    def measures(n, values):
        return {SURFACE_ERROR: 0.01 / (n + 1), PHASE_ERROR: -0.1 / (n + 1)}, {}, {"CPU [s]": n + 1.0}

    table = study_table(
        CASES / "standing-wave.toml", ["dt=0.02,0.04", "n=4,6", "integrator=third-order,simpson-4"], measures
    )
    plan = marked_combination(CASES / "standing-wave.toml", ["dt=0.03", "p=4"])
    table.rows.append(Row(plan.values, "finished", "", table.rows[0].errors, {}, {"CPU [s]": 2.0}, plan.mark))
    case = read_case(CASES / "standing-wave.toml", ["title=Title"])
    text = draw_trade(replace(table, axes=[*table.axes, Axis.of("p")], case=case), tmp_path / "study.svg").read_text()
    words = {part.split("-->")[0].strip() for part in text.split("<!--")[1:]}
    assert {"CPU time of stepping [s]", SURFACE_ERROR, PHASE_ERROR} <= words
    assert {"third-order", "simpson-4", "n = 4", "n = 6"} <= words
    assert {"plan: dt 0.03, p 4", "0.04, 6", "Title: work and precision"} <= words
    assert any(word.startswith("Pareto front (dt [s], n)") for word in words)


def test_trade_labels_the_pareto_front_and_opens_marks_of_warnings(drawn, tmp_path):
    """Each point of the front has a label, no label covers another; axes of less than a decade have numbers."""
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
    assert opened(figure.axes[0]) == [point] and {WARNING_LABEL, "broke down: 1 of 7 runs"} <= legend(figure)
    for panel in figure.axes:
        assert len(panel.texts) > 2
        assert {text.get_text() for text in panel.texts} <= {f"{float(step):.3g}" for step in steps}


def test_study_of_a_physical_key_draws_responses_over_it(drawn, tmp_path):
    """A line for each vertical order over heights; errors beside; a cross on the axis where no run has finished."""

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
    panels = [panel for panel in figure.axes if panel.axison]
    assert {panel.get_ylabel() for panel in panels} == {CREST, TROUGH, CREST_PLACE, SURFACE_ERROR, PHASE_ERROR}
    for panel in panels:
        assert {place for line in panel.lines if line.get_marker() == "x" for place in line.get_xdata()} == {0.08}
        assert panel.get_xlim()[1] > 0.08 and panel.get_xlabel() == "initial.wave_amplitude [m]"
    of_runs = {WARNING_LABEL, "broke down: 2 of 9 runs", "waves broke and were damped: 1 of 9 runs"}
    assert legend(figure) == {"n = 4", "n = 6", "plan: initial.wave_amplitude 0.01, n 6", *of_runs}
    np.testing.assert_allclose(figure.axes[0].lines[0].get_xydata(), [(a, 1.2 * a) for a in (0.01, 0.02, 0.04)])


def test_study_of_a_physical_key_without_numbers_names_its_values(drawn, tmp_path):
    def measures(n, values):
        return {SURFACE_ERROR: 0.1}, {CREST: 0.1 + n, TROUGH: -0.1, CREST_PLACE: 0.0}

    table = study_table("standing-wave.toml", ["water.type=linear,nonlinear"], measures)
    table.rows.append(Row(table.rows[1].values, "broke down", warnings="it breaks"))  # its warning is of no mark
    draw_responses(table, tmp_path / "study.png")
    (figure,) = drawn
    assert not faults(figure)
    assert not opened(figure.axes[0]) and WARNING_LABEL not in legend(figure)
    assert len([panel for panel in figure.axes if panel.lines]) == 3  # without a sweep of numerics no errors
    assert [label.get_text() for label in figure.axes[0].get_xticklabels()] == ["linear", "nonlinear"]
