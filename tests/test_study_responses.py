"""Studies of physics: responses by name and formula, ensembles of seeds, pictures, of waves that are known."""

import csv
import io
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from conftest import CHECKOUT
from pictures import faults
from rich.console import Console
from scipy import stats

from wavetank.analysis.quantities import AT_GAUGE, OF_RUN
from wavetank.case.reading import read_case
from wavetank.errors import InputError
from wavetank.output.writer import RunWriter
from wavetank.studies.drawing import WARNED, draw_ensembles
from wavetank.studies.measures import Response, responses, usual_responses
from wavetank.studies.runs import Outcome
from wavetank.studies.study import Study
from wavetank.studies.sweep import Axis, Combination, combinations, parse_axes, parse_axis
from wavetank.studies.table import Row, ensembles, write_ensembles, write_table
from wavetank.waves.airy import wave_number

CASE = CHECKOUT / "cases" / "wavemaker.toml"
PERIOD, OMEGA = 2.0, np.pi
K = float(wave_number(OMEGA, 1.0, 9.81))


def eta(x, t):
    """Return regular waves of 5 cm, of which a tenth comes back, with a second harmonic; still before t = 8 s."""
    waves = 0.05 * np.cos(K * x - OMEGA * t) + 0.005 * np.cos(K * x + OMEGA * t) + 0.004 * np.cos(2 * OMEGA * t)
    return waves * (t >= 8.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run directory with these waves."""
    from wavetank.output.directory import RunDirectory

    path, scene = tmp_path_factory.mktemp("runs") / "run", read_case(CASE)
    x, places = np.linspace(0, 40, 401), np.array([gauge.x for gauge in scene.all_gauges])
    with RunWriter(path, {"scene": scene.model_dump(mode="json")}) as writer:
        gauges, surface = writer.gauges([(gauge.name, gauge.x) for gauge in scene.all_gauges]), writer.surface()
        for t in np.arange(0, 24, 0.05):
            gauges.append([t, *eta(places, t)])
            surface.append(t, x, eta(x, t), 0 * x)
        writer.finish("finished", {})
    return RunDirectory(path)


def of(run, *texts, start=8.0):
    told, causes = responses(run, [Response(text) for text in texts], start=start)
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
    highest, where, when, lowest = responses(run, usual_responses(read_case(CASE)))[0].values()
    assert highest == pytest.approx(eta(where, when)) and lowest < 0 < highest


@pytest.mark.parametrize("name", [*OF_RUN, *(f"{name}@2" for name in AT_GAUGE)])
def test_every_quantity_is_a_number_with_its_unit(run, name):
    (value,) = of(run, name)
    response = Response(name)
    assert np.isfinite(value) and response.label == f"{name} [{response.quantities[0].unit}]"


def test_formulae_name_their_columns():
    assert Response("transmission [-] = hm0@2 / hm0@1").label == "transmission [-]"
    assert Response("sqrt(crest@1**2 + 1e-3) - 0.5*pi*hm0@'a b'").label == "sqrt(crest@1**2 + 1e-3) - 0.5*pi*hm0@'a b'"
    assert [one.gauge for one in Response("max(hm0@A.3, crest) - hm0@'a b'").quantities] == ["A.3", None, "a b"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("hm0", "'hm0' is no quantity; it is one of a gauge, hm0@GAUGE"),
        ("crst", "'crst' is no quantity; did you mean 'crest'? allowed are: crest"),
        ("run_up@1", "'run_up@1' is no quantity"),
        ("2 + 2", "allowed are formulae of crest, crest_x"),
        ("crest +", "invalid syntax"),
        ("open(crest)", "is not a function of a formula"),
        ("", "allowed are formulae of"),
        ("hm0@9", "there is no gauge '9'; there are 1, 2, 3"),
    ],
)
def test_bad_response_is_refused_before_anything_runs(tmp_path, text, said):
    with pytest.raises(InputError) as error:
        Study(CASE, ["tank.depth=1,2"], requested=[text], out=tmp_path / "out", console=Console(file=io.StringIO()))
    assert said in str(error.value) and len(str(error.value).splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_response_that_a_run_does_not_contain_is_nan_with_a_cause(run):
    told, causes = responses(run, [Response("h_max@1"), Response("crest")], start=23.5)
    assert list(told) == ["h_max@1 [m]", "crest [m]"] and np.isnan(told["h_max@1 [m]"]) and len(causes) == 1
    assert causes[0].startswith("h_max@1 [m]: gauge 1: 0 whole waves")


def test_response_of_no_run_is_an_empty_column(tmp_path):
    (one,) = combinations(CASE, parse_axes(["tank.depth=1.0"]))
    row = Row(one, Outcome("finished"), responses={"h_mean@2 [m]": np.nan, "crest [m]": 0.1})
    write_table(tmp_path / "study.csv", [row], parse_axes(["tank.depth=1.0"]))
    with (tmp_path / "study.csv").open() as file:
        (table,) = csv.DictReader(file)
    assert (table["h_mean@2 [m]"], table["crest [m]"]) == ("", "0.1")


# ---------------------------------------------------------------- what is swept
def test_ranges_of_seeds_are_expanded():
    assert parse_axis("wall.motion.seed=1..4,9") == Axis("wall.motion.seed", ("1", "2", "3", "4", "9"))
    assert Axis.of("wall.motion.seed").seeds and not Axis.of("tank.depth").seeds
    for text in ("a.seed=4..1", "a.seed=1..99999", "a.seed=1..3,2"):
        with pytest.raises(InputError, match="sweep"):
            parse_axis(text)


# ---------------------------------------------------------------- ensembles
def made(seeds: int, settings: dict[str, list[str]], response) -> tuple[list[Row], list[Axis]]:
    """Return rows and axes of a study of seeds, with a response of the settings and the seed."""
    axes = [Axis(key, tuple(values)) for key, values in settings.items()]
    (first, *_), rows = combinations(CASE, parse_axes(["tank.depth=1.0"])), []
    for *values, seed in product(*settings.values(), range(seeds)):
        named = dict(zip(settings, values, strict=True)) | {"wall.motion.seed": str(seed)}
        one: Combination = replace(first, name=str(named), values=named)
        rows.append(Row(one, Outcome("finished"), responses={"hm0 [m]": response(named), "crest [m]": 0.1 * seed}))
    return rows, [*axes, Axis("wall.motion.seed", tuple(map(str, range(seeds))))]


def test_ensemble_has_mean_confidence_and_quantiles(tmp_path):
    """Oracle: scipy.stats' t interval, numpy's quantiles; settings apart, failed and marked runs left out."""
    rng = np.random.default_rng(1)
    rows, axes = made(9, {"tank.depth": ["1", "2"]}, lambda named: float(named["tank.depth"]) + rng.normal())
    rows[3] = replace(rows[3], responses={})
    found = ensembles([*rows, replace(rows[0], mark="plan")], axes)
    assert [(one.settings["tank.depth"], one.response, one.values.size) for one in found] == [
        ("1", "hm0 [m]", 8), ("2", "hm0 [m]", 9), ("1", "crest [m]", 8), ("2", "crest [m]", 9),
    ]  # fmt: skip
    for one in found:
        interval = stats.t.interval(0.95, one.values.size - 1, one.mean, stats.sem(one.values))
        assert (one.mean - one.half_width, one.mean + one.half_width) == pytest.approx(interval)
        assert one.quantiles == pytest.approx(np.quantile(one.values, (0.05, 0.5, 0.95)))
    assert write_ensembles(tmp_path / "ensemble.csv", found).row_count == 4
    with (tmp_path / "ensemble.csv").open() as file:
        table = list(csv.DictReader(file))
    assert (table[0]["tank.depth"], table[0]["runs"]) == ("1", "8")
    assert float(table[1]["mean to"]) == pytest.approx(found[1].mean + found[1].half_width, rel=1e-6)


# ---------------------------------------------------------------- pictures


@pytest.mark.parametrize("settings", [{}, {"tank.depth": ["1", "2", "4"]}, {"water.type": ["linear", "nonlinear"]}])
def test_ensembles_are_drawn(drawn, tmp_path, settings):
    rng = np.random.default_rng(1)
    rows, axes = made(9, settings, lambda named: 1 + 0.1 * rng.normal())
    rows[4], rows[6] = replace(rows[4], warnings=["it breaks"]), replace(rows[6], responses={})
    draw_ensembles(rows, ensembles(rows, axes), axes, tmp_path / "study.png", title="A sea")
    (figure,) = drawn
    crests = figure.axes[1]
    assert [
        line.get_ydata().tolist() for line in crests.lines if line.get_mfc() == "white" and line.get_xdata().size
    ] == [[0.4]]
    assert figure.legends[0].get_texts()[-1].get_text() == WARNED
    assert not faults(figure) and {panel.get_ylabel() for panel in figure.axes} == {"hm0 [m]", "crest [m]"}
