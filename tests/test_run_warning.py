"""Warnings are records: stored, read and rendered."""

import json
import re
from pathlib import Path
from string import Formatter

import pytest

from wavetank.base.run_warning import MESSAGES, TEXT, RunWarning, run_warning
from wavetank.output.directory import RunDirectory
from wavetank.output.writer import RunWriter

FAILED = RunWarning("copy-failed", key="gauges.nc", details={"reason": "no space", "table": "gauges.csv"})
SENTENCE = "gauges.nc could not be written (no space); gauges.csv has the same"


def test_every_code_has_a_sentence_and_every_sentence_a_producer():
    package = Path(__file__).resolve().parents[1] / "wavetank"
    source = "".join(file.read_text() for file in package.rglob("*.py") if file.name != "run_warning.py")
    assert {*re.findall(r'RunWarning\(\s*"([^"]+)"', source)} <= set(MESSAGES)
    assert all(f'"{code}"' in source for code in MESSAGES if code != TEXT)
    for template in MESSAGES.values():
        [*Formatter().parse(template)]  # raises ValueError for a template that cannot be formatted


@pytest.mark.parametrize(
    "warning",
    [
        FAILED,
        RunWarning("second-order-limit", key="wall.motion.generation", value=0.123456789, limit=0.1, until=2.5),
        run_warning("the bed is missed"),
    ],
)
def test_a_warning_read_from_json_equals_the_written_one(warning):
    assert run_warning(json.loads(json.dumps(warning.as_json()))) == warning


def test_place_and_end_of_validity_are_rendered(monkeypatch):
    monkeypatch.setitem(MESSAGES, "high", "{value:g} m at {place}")
    warning = RunWarning("high", value=2.0, x=1.5, until=3.0)
    assert str(warning) == "up to t = 3 s, 2 m at x = 1.5 m"
    assert str(RunWarning("high", value=2.0, x=1.5, y=0.25)) == "2 m at x = 1.5 m, y = 0.25 m"


@pytest.mark.parametrize(
    ("stored", "sentence"),
    [
        (FAILED.as_json(), SENTENCE),
        ("it is steep", "it is steep"),  # a manifest of an older version
        ({"code": "unknown", "value": 1.0, "message": "it leaks"}, "it leaks"),  # of a newer one
        (FAILED.as_json() | {"details": {}}, SENTENCE),  # with other details
    ],
)
def test_run_directory_returns_warnings_of_any_version(stored, sentence, tmp_path):
    with RunWriter(tmp_path, {"warnings": [stored]}) as writer:
        writer.finish("finished", {})
    assert [str(one) for one in RunDirectory(tmp_path).warnings] == [sentence]
