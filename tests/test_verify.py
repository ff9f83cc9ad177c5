"""What ``wavetank verify integrators`` writes: every table with its picture, readable, and bad folders refused."""

import csv
import re

import pytest
from conftest import CHECKOUT
from rich.console import Console

from examples.paper import integrators
from examples.paper.report import Report
from examples.paper.schemes import simpson
from examples.paper.work_precision import Tank
from wavetank.cli import main

SLOW = ("overview", "work_precision", "damped_jumps", "long_orbits")
EXPECTED = {
    "overview": {"schemes.csv", "jumps.csv", "jumps.png"},
    "table_1": {"table-1.csv", "table-1.png"},
    "stability": {"stability-limits.csv", "figure-4.csv", "figure-4.png", "figure-5.csv", "figure-5.png"},
    "dispersion": {"frequency-errors.csv", "figure-6.csv", "figure-6.png", "starts.csv", "starts.png"},
    "symplecticity": {"symplecticity.csv", "symplecticity.png"},
    "phase_space": {"figures-7-8.csv", "figure-7.png", "figure-8.png"},
    "damping": {"damping.csv", "figure-9.csv", "figure-9.png"},
    "forcing": {"forcing.csv", "forcing.png"},
    "work_precision": {"work-precision.csv", "work-precision.png"},
    "parasitic": {"parasitic.csv", "parasitic.png"},
    "damped_jumps": {
        *(f"damped-jumps-{name}.csv" for name in ("limits", "cures")),
        *(f"damped-jumps-{name}.png" for name in ("roots", "cures")),
    },
    "long_orbits": {"long-orbits.csv", "long-orbits.png"},
}


def name(part) -> str:
    return part.__name__.rpartition(".")[2]


def write(part, folder):
    part.write(Report(folder, Console(quiet=True)))
    assert {path.name for path in folder.iterdir()} == EXPECTED[name(part)]
    tables = {path.stem: path.read_text(encoding="utf-8").splitlines() for path in folder.glob("*.csv")}
    for lines in tables.values():
        rows = list(csv.reader(lines))
        assert len(rows) > 2 and {len(row) for row in rows} == {len(rows[0])}
    return {name: list(csv.DictReader(lines)) for name, lines in tables.items()}


LONG = (
    "stability",
    "dispersion",
    "symplecticity",
    "forcing",
    "parasitic",
)  # of seconds; what they write is as in the others


@pytest.mark.parametrize(
    "part",
    [
        pytest.param(part, id=name(part), marks=[pytest.mark.slow] * (name(part) in LONG))
        for part in integrators.PARTS
        if name(part) not in SLOW
    ],
)
def test_a_part_writes_its_tables_and_pictures(part, tmp_path):
    write(part, tmp_path)


@pytest.mark.slow
def test_the_overview(tmp_path):
    for row in write(integrators.overview, tmp_path)["schemes"]:
        for kind in ("order_linear", "order_nonseparable"):
            assert float(row[kind]) == pytest.approx(int(row["stated_order"]), abs=0.15)


@pytest.mark.slow
def test_of_all_cures_the_third_difference_is_the_one(tmp_path):
    """On the orbits on which (23) fails, at 48 steps a period: least error, but for Gauss-Legendre's of half that."""
    rows = write(integrators.damped_jumps, tmp_path)["damped-jumps-cures"]
    for q in ("1", "1.2", "1.5"):
        orbit = [row for row in rows if (row["q"], row["steps_per_period"]) == (q, "48")]
        found = {row["cure"]: float(row["largest_error"]) for row in orbit}
        chosen = found.pop("third difference, κ = 0.1")
        assert chosen < 2 * found.pop("Gauss-Legendre 4") and chosen < 1.05 * min(found.values())


@pytest.mark.slow
def test_energy_drifts_over_1e5_periods_as_theory_has_it(tmp_path):
    """To leading order in the step: at 40 and 48 steps a period within a tenth, at 16 within a third."""
    rows = write(integrators.long_orbits, tmp_path)["long-orbits"]
    damped = [row for row in rows if row["scheme"] == "Simpson 4"]
    ratios = [float(row["drift_per_period"]) / float(row["predicted"]) for row in damped]
    assert ratios == sorted(ratios) and ratios[0] > 0.67 and 0.9 < ratios[-2] < ratios[-1] < 1
    assert max(abs(float(row["drift_per_period"])) for row in rows if row not in damped) < 1e-14


@pytest.mark.slow
def test_the_third_order_scheme_needs_least_work_for_a_small_error(tmp_path):
    """Work to reach an error of 1 % of the radius on the oscillators, 0.1 % of the amplitude in the tank."""
    rows = write(integrators.work_precision, tmp_path)["work-precision"]
    for system, wanted in (("linear", 1e-2), ("non-separable", 1e-2), ("tank", 1e-3)):
        good = [row for row in rows if row["system"] == system and float(row["error"]) < wanted]
        least = min(good, key=lambda row: int(row["evaluations"]))
        assert least["scheme"] in ("third order (23)", "Simpson 4")


def test_documented_evaluations_are_those_of_the_scheme():
    """Oracle: the table of docs/integrators.md, within a tenth: solvers' iterations differ between platforms."""
    rows = re.findall(r"^\| (.+?) \| (\d+) \| .*⁻", (CHECKOUT / "docs/integrators.md").read_text(), re.MULTILINE)
    _, evaluations = Tank().run(simpson().integrator, 36)
    assert evaluations == pytest.approx(int(dict(rows)["Simpson 4"]), rel=0.1)


def test_a_folder_that_cannot_be_written_is_refused(wavetank, tmp_path):
    (tmp_path / "file").write_text("")
    result = wavetank("verify", "integrators", "--out", str(tmp_path / "file"))
    assert result.returncode == 2 and result.stderr.count("\n") == 1


def test_what_is_refused_ends_all_ranks(on_ranks, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    assert on_ranks(main, ["verify", "integrators", "--out", str(tmp_path)]) == [2, 2, 2]
