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

from wavetank.base.errors import InputError
from wavetank.case.reading import read_case
from wavetank.output.writer import RunWriter
from wavetank.studies.drawing import WARNED, draw_ensembles
from wavetank.studies.responses import QUANTITIES, evaluate_responses, parse_response, usual_responses
from wavetank.studies.study import run_study
from wavetank.studies.sweep import Axis, parse_axis
from wavetank.studies.table import Row, StudyTable, ensembles
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
            surface.append(np.hstack([t, x, eta(x, t), 0 * x]))
        writer.finish("finished", {})
    return RunDirectory(path)


def of(run, *texts, start=8.0):
    told, causes = evaluate_responses(run, [parse_response(text) for text in texts], start=start)
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
    highest, where, when, lowest = evaluate_responses(run, usual_responses(read_case(CASE)))[0].values()
    assert highest == pytest.approx(eta(where, when)) and lowest < 0 < highest


@pytest.mark.parametrize("key", [key for key in QUANTITIES if not key.endswith("@LOAD")])
def test_every_quantity_is_a_number_with_its_unit(run, key):
    name = key.replace("GAUGE", "2")
    (value,) = of(run, name)
    assert np.isfinite(value) and parse_response(name).label == f"{name} [{QUANTITIES[key].unit}]"


def test_formulae_name_their_columns():
    assert parse_response("transmission [-] = hm0@2 / hm0@1").label == "transmission [-]"
    assert (
        parse_response("sqrt(crest@1**2 + 1e-3) - 0.5*pi*hm0@'a b'").label
        == "sqrt(crest@1**2 + 1e-3) - 0.5*pi*hm0@'a b'"
    )
    assert [name for _, name in parse_response("max(hm0@A.3, crest) - hm0@'a b'").quantities] == ["A.3", "", "a b"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("hm0", "'hm0' is no quantity; it is hm0@GAUGE"),
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
        run_study(CASE, ["tank.depth=1,2"], requested=[text], out=tmp_path / "out", console=Console(file=io.StringIO()))
    assert said in str(error.value) and len(str(error.value).splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_response_that_a_run_does_not_contain_is_nan_with_a_cause(run):
    told, causes = evaluate_responses(run, [parse_response("h_max@1"), parse_response("crest")], start=23.5)
    assert list(told) == ["h_max@1 [m]", "crest [m]"] and np.isnan(told["h_max@1 [m]"]) and len(causes) == 1
    assert causes[0].startswith("h_max@1 [m]: gauge 1: 0 whole waves")


def test_response_of_no_run_is_an_empty_column(tmp_path):
    row = Row({"tank.depth": "1.0"}, "finished", responses={"h_mean@2 [m]": np.nan, "crest [m]": 0.1})
    StudyTable([row], [Axis("tank.depth", ("1.0",))], read_case(CASE)).write(tmp_path / "study.csv")
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
def made(seeds: int, settings: dict[str, list[str]], response) -> StudyTable:
    """Return the table of a study of seeds, with a response of the settings and the seed."""
    axes, rows = [Axis(key, tuple(values)) for key, values in settings.items()], []
    for *values, seed in product(*settings.values(), range(seeds)):
        named = dict(zip(settings, values, strict=True)) | {"wall.motion.seed": str(seed)}
        rows.append(Row(named, "finished", responses={"hm0 [m]": response(named), "crest [m]": 0.1 * seed}))
    axes.append(Axis("wall.motion.seed", tuple(map(str, range(seeds)))))
    return StudyTable(rows, axes, read_case(CASE, ["title=A sea"]))


def test_ensemble_has_mean_confidence_and_quantiles():
    """Oracle: scipy.stats' t interval, numpy's quantiles; settings apart, failed and marked runs left out."""
    rng = np.random.default_rng(1)
    table = made(9, {"tank.depth": ["1", "2"]}, lambda named: float(named["tank.depth"]) + rng.normal())
    table.rows[3] = table.rows[3]._replace(responses={})
    found = ensembles(replace(table, rows=[*table.rows, table.rows[0]._replace(mark="plan")]))
    assert [*found[["tank.depth", "response", "runs"]].itertuples(index=False, name=None)] == [
        ("1", "hm0 [m]", 8), ("2", "hm0 [m]", 9), ("1", "crest [m]", 8), ("2", "crest [m]", 9),
    ]  # fmt: skip
    for _, one in found.iterrows():
        chosen = [
            row.responses for row in table.rows if row.values["tank.depth"] == one["tank.depth"] and row.responses
        ]
        values = [responses[one["response"]] for responses in chosen]
        interval = stats.t.interval(0.95, len(values) - 1, one["mean"], stats.sem(values))
        assert (one["mean from"], one["mean to"]) == pytest.approx(interval)
        assert [*one[["5 %", "50 %", "95 %"]]] == pytest.approx(np.quantile(values, (0.05, 0.5, 0.95)))
        assert one["standard deviation"] == pytest.approx(np.std(values, ddof=1))


# ---------------------------------------------------------------- pictures


@pytest.mark.parametrize("settings", [{}, {"tank.depth": ["1", "2", "4"]}, {"water.type": ["linear", "nonlinear"]}])
def test_ensembles_are_drawn(drawn, tmp_path, settings):
    rng = np.random.default_rng(1)
    table = made(9, settings, lambda named: 1 + 0.1 * rng.normal())
    table.rows[4:7:2] = table.rows[4]._replace(warnings="it breaks"), table.rows[6]._replace(responses={})
    draw_ensembles(table, ensembles(table), tmp_path / "study.png")
    (figure,) = drawn
    crests = figure.axes[1]
    assert [
        line.get_ydata().tolist() for line in crests.lines if line.get_mfc() == "white" and line.get_xdata().size
    ] == [[0.4]]
    assert figure.legends[0].get_texts()[-1].get_text() == WARNED
    assert not faults(figure) and {panel.get_ylabel() for panel in figure.axes} == {"hm0 [m]", "crest [m]"}
