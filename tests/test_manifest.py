"""A manifest with values of wrong types is refused in one sentence, whatever reads it; other manifests are read."""

import json
import random

import numpy as np
import pytest

from wavetank.analysis.record import read_record
from wavetank.base.errors import InputError
from wavetank.case import Case
from wavetank.cli import main
from wavetank.output.directory import RunDirectory
from wavetank.output.manifest import MANIFEST
from wavetank.output.status import status_line
from wavetank.output.writer import RunWriter
from wavetank.recording.restart import stored_scene

SCENE = {
    "tank": {"type": "slice", "length": 12.0, "depth": 0.5},
    "wall": {"type": "piston", "motion": {"type": "sinusoid", "paddle_amplitude": 0.02, "period": 1.4}},
    "sponge": {"type": "end", "length": 4.0},
    "gauges": [{"name": "1", "x": 2.0}, {"name": "2", "x": 3.0}],
    "run": {"duration": 0.5},
}
TOLD = {
    "host": "elsewhere",
    "git": "abc123",
    "command": ["wavetank", "run", "case.toml"],
    "started": "2025-01-02T03:04:05+00:00",
    "warnings": ["it is steep"],
    "versions": {"wavetank": "1.2.3"},
    "files": {},
    "progress": {"t": 0.4, "begin": 0.0, "end": 0.5, "step": 4, "wall_s": 3.0},
    "numerics": {"dt": 0.1, "order": 2},
    "timings": {"stepping_cpu_s": 1.0},
    "counters": {"interior_solves": 4},
    "highest_crest": {"height": 0.1, "x": 1.0, "y": 0.0, "t": 0.3},
    "breaking": {"waves": 1},
    "broke_down": {"t": 0.4, "steepest": {"x": 1.0}, "crests": [{"x": 1.0, "height": 0.1, "speed_ratio": 0.9}]},
}
WRONG = (None, "x", 1, -2.5, [], {}, True, ["a"], [{}], {"a": 1}, float("nan"), float("inf"))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return the directory of a run of five rows that broke down."""
    path = tmp_path_factory.mktemp("runs") / "run"
    with RunWriter(path, {"scene": Case.model_validate(SCENE).model_dump(mode="json"), **TOLD}) as writer:
        gauges, energy = writer.gauges([("1", 2.0), ("2", 3.0)]), writer.table("energy.csv", ["t [s]", "total"])
        gauges.extend(np.arange(5)[:, None] * [0.1, 0.01, -0.02])
        energy.extend(np.arange(5)[:, None] * [0.1, 1.0])
        writer.finish("broke down", {"cause": "t = 0.4 s: the wave broke."})
    return path


@pytest.fixture
def write(run):
    """Return what writes another manifest into the run; afterwards it has its own."""
    good = (run / MANIFEST).read_text()
    yield lambda manifest: (run / MANIFEST).write_text(json.dumps(manifest))
    (run / MANIFEST).write_text(good)


def places(value, path=()):
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in items:
        yield from places(part, (*path, key))


def changed(value, path, wrong):
    """Return a copy of a value with something else at a place."""
    if not path:
        return wrong
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = changed(value[path[0]], path[1:], wrong)
    return copy


def test_any_wrong_value_is_refused_or_read(run, write):
    """Seeded mutations of every place of the manifest: each command works or raises ``InputError``."""
    manifest = RunDirectory(run).manifest
    every = [(path, wrong) for path in places(manifest) for wrong in WRONG]
    refused = 0
    for path, wrong in random.Random(33).sample(every, 300):
        write(changed(manifest, path, wrong))
        for read in (
            lambda: status_line(run),
            lambda: read_record(str(run)),
            lambda: stored_scene(run, extend=1.0),
        ):
            try:
                read()
            except InputError:
                refused += 1
            except Exception as error:
                raise AssertionError(f"{'.'.join(map(str, path))} = {wrong!r}") from error
    assert refused > 300


@pytest.mark.parametrize(
    ("path", "wrong", "said"),
    [
        (("progress", "t"), "x", "progress.t: input should be a valid number"),
        (("warnings",), 1, "warnings: input should be a valid array"),
        (("written",), [], "written: input should be a valid datetime"),
        (("scene", "tank"), 1, "scene.tank: input should be an object"),
        (("scene", "wall", "motion", "period"), "1.4", "scene.wall.motion.period: input should be a valid number"),
        (("scene", "run", "duration"), float("nan"), "scene.run.duration: input should be a finite number"),
    ],
)
def test_the_key_of_a_wrong_value_is_named(path, wrong, said, run, write, capsys, tmp_path):
    write(changed(RunDirectory(run).manifest, path, wrong))
    assert main(["status", str(run)]) == 0
    assert f"unreadable; {run / MANIFEST}: {said}" in "".join(capsys.readouterr().out.split("\n"))
    for command in (["compare", "--with", str(run)], ["analyse"], ["resume"], ["view"]):
        assert main([command[0], str(run), *command[1:]]) == 2
        assert f"wavetank: {run / MANIFEST}: {said}" in capsys.readouterr().err
