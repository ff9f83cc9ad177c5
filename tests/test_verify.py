"""What ``wavetank verify integrators`` writes: every table with its picture, readable, and bad folders refused."""

import re

import pytest
from conftest import CHECKOUT
from records import csv_rows, refusal
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
    "damped_jumps": {f"damped-jumps-{name}" for name in ("limits.csv", "cures.csv", "roots.png", "cures.png")},
    "long_orbits": {"long-orbits.csv", "long-orbits.png"},
}


FAST = ("phase_space", "damping")  # what the others write is alike
PARTS = {part.__name__.rpartition(".")[2]: part for part in integrators.PARTS}


def write(name, folder):
    """Return the tables that a part writes, by their names."""
    PARTS[name].write(Report(folder, Console(quiet=True)))
    assert {path.name for path in folder.iterdir()} == EXPECTED[name]
    tables = {path.stem: csv_rows(path) for path in folder.glob("*.csv")}
    for rows in tables.values():
        assert len(rows) > 1 and not any(None in row or None in row.values() for row in rows)
    return tables


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name not in FAST)) for name in PARTS if name not in SLOW],
)
def test_a_part_writes_its_tables_and_pictures(name, tmp_path):
    write(name, tmp_path)


@pytest.mark.slow
def test_the_overview(tmp_path):
    for row in write("overview", tmp_path)["schemes"]:
        for kind in ("order_linear", "order_nonseparable"):
            assert float(row[kind]) == pytest.approx(int(row["stated_order"]), abs=0.15)


@pytest.mark.slow
def test_of_all_cures_the_third_difference_is_the_one(tmp_path):
    """On the orbits on which (23) fails, at 48 steps a period: least error, but for Gauss-Legendre's of half that."""
    rows = write("damped_jumps", tmp_path)["damped-jumps-cures"]
    for q in ("1", "1.2", "1.5"):
        orbit = [row for row in rows if (row["q"], row["steps_per_period"]) == (q, "48")]
        found = {row["cure"]: float(row["largest_error"]) for row in orbit}
        chosen = found.pop("third difference, κ = 0.1")
        assert chosen < 2 * found.pop("Gauss-Legendre 4") and chosen < 1.05 * min(found.values())


@pytest.mark.slow
def test_energy_drifts_over_1e5_periods_as_theory_has_it(tmp_path):
    """To leading order in the step: at 40 and 48 steps a period within a tenth, at 16 within a third."""
    rows = write("long_orbits", tmp_path)["long-orbits"]
    damped = [row for row in rows if row["scheme"] == "Simpson 4"]
    ratios = [float(row["drift_per_period"]) / float(row["predicted"]) for row in damped]
    assert ratios == sorted(ratios) and ratios[0] > 0.67 and 0.9 < ratios[-2] < ratios[-1] < 1
    assert max(abs(float(row["drift_per_period"])) for row in rows if row not in damped) < 1e-14


@pytest.mark.slow
def test_the_third_order_scheme_needs_least_work_for_a_small_error(tmp_path):
    """Work to reach an error of 1 % of the radius on the oscillators, 0.1 % of the amplitude in the tank."""
    rows = write("work_precision", tmp_path)["work-precision"]
    for system, wanted in (("linear", 1e-2), ("non-separable", 1e-2), ("tank", 1e-3)):
        good = [row for row in rows if row["system"] == system and float(row["error"]) < wanted]
        least = min(good, key=lambda row: int(row["evaluations"]))
        assert least["scheme"] in ("third order (23)", "Simpson 4")


def test_documented_evaluations_are_those_of_the_scheme():
    """Oracle: the table of docs/integrators.md, within a tenth: solvers' iterations differ between platforms."""
    rows = re.findall(r"^\| (.+?) \| (\d+) \| .*⁻", (CHECKOUT / "docs/integrators.md").read_text(), re.MULTILINE)
    _, evaluations = Tank().run(simpson().integrator, 36)
    assert evaluations == pytest.approx(int(dict(rows)["Simpson 4"]), rel=0.1)


def test_a_folder_that_cannot_be_written_is_refused_on_all_ranks(on_ranks, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    assert refusal("verify", "integrators", "--out", str(tmp_path / "notes.txt"))
    assert on_ranks(main, ["verify", "integrators", "--out", str(tmp_path)]) == [2, 2, 2]
