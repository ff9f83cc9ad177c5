"""Small cases, and runs of them: recorded, ended after a step, resumed, compared."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from wavetank.base.console import console
from wavetank.base.errors import RunError
from wavetank.case import Case
from wavetank.output.directory import ENERGY, GAUGES, PADDLE, RunDirectory
from wavetank.recording import record_run
from wavetank.simulation import run as running
from wavetank.simulation.monitoring import Checkpoints

MOTION = {"type": "sinusoid", "paddle_amplitude": 0.05, "period": 1.6, "ramp": 0.4}
SLICE = {
    "tank": {"length": 6.0, "depth": 0.6},
    "wall": {"type": "piston", "reach": 2.0, "motion": MOTION},
    "sponge": {"type": "end", "length": 2.0, "strength": 6.0},
    "gauges": [1.0, 2.5],
    "run": {"duration": 0.5, "on_breaking": "dissipate"},
    "numerics": {"cells": 12, "vertical_order": 4, "dt": 0.05, "tolerance": 1e-6},
}
FLAP = SLICE | {"wall": SLICE["wall"] | {"type": "flap"}}
RING = {
    "tank": {"type": "ring", "length": 6.0, "depth": 1.0},
    "initial": {"type": "stream-function", "steepness": 0.6},
    "gauges": [0.0, 2.0],
    "run": {"duration": 0.4},
    "numerics": {"cells": 16, "vertical_order": 4, "dt": 0.025},
}
OBLIQUE = {"type": "oblique-wave", "wave_amplitude": 0.02, "period": 1.2, "angle": 20.0}
BASIN = {
    "tank": {"type": "basin", "depth": 0.5, "layout": {"type": "rectangle", "length": 4.0, "width": 3.0}},
    "wall": {"type": "segmented-piston", "segment": 0.5, "reach": 1.5, "motion": OBLIQUE},
    "sponge": {"type": "end", "length": 1.5},
    "gauges": [{"x": 2.0, "y": 1.2}],
    "run": {"duration": 0.6},
    "numerics": {"cell_size": 0.5, "order": 2, "vertical_order": 2, "dt": 0.06, "tolerance": 1e-6},
}
SLOSHING = {
    "tank": {"length": 2.0, "depth": 1.0},
    "initial": {"type": "standing-wave", "wave_amplitude": 0.02},
    "gauges": [0.0, 0.7],
    "run": {"duration": 0.8},
    "numerics": {"cells": 6, "vertical_order": 4, "dt": 0.05},
}
OUTPUT = {"surface_every": 0.1, "velocity_every": 0.15}


def case_of(parts: dict, **run: object) -> Case:
    """Return a case that records surfaces and velocities, with changes of its table ``run``."""
    return Case.model_validate({"output": OUTPUT} | parts | {"run": parts["run"] | run})


def record(
    parts: dict | Case, out: Path, run: dict | None = None, resume: bool = False, **options: object
) -> RunDirectory:
    """Record a run, or resume it; collective."""
    case = parts if isinstance(parts, Case) else case_of(parts, **(run or {}))
    record_run(case, out, comm=MPI.COMM_WORLD, console=console(), resume=resume, **options)
    return RunDirectory(out)


@contextmanager
def ending(*, written: int, after: int) -> Iterator[None]:
    """Let runs write a checkpoint of the start and after a step, and end after a later one."""

    def record(self, block):
        if block.step[-1] in (0, written):
            self._write()
        if block.step[-1] == after:
            raise RunError("it ends here")

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(running, "LONGEST", 1)
        patched.setattr(Checkpoints, "record", record)
        yield


def record_until(
    parts: dict | Case, out: Path, run: dict | None, written: int, after: int, resume: bool = False
) -> None:
    """Record a run that ends after a step, with a checkpoint of an earlier one; collective."""
    with ending(written=written, after=after), pytest.raises(RunError, match="it ends here"):
        record(parts, out, run, resume)


def same(run: Path, other: Path, *, tolerance: float = 0.0) -> None:
    """Assert that the records of two runs are equal, to a part of the highest elevation in the gauges."""
    one, two = RunDirectory(run), RunDirectory(other)
    assert one.status == two.status == "finished"
    for file in (GAUGES, ENERGY, PADDLE):
        if (run / file).exists():
            (head, rows), (its_head, its_rows) = one._table(file), two._table(file)
            assert head == its_head and rows.shape == its_rows.shape
            np.testing.assert_allclose(rows, its_rows, rtol=tolerance, atol=tolerance * np.abs(rows[:, 1]).max())
    fields = [name for name in ("surface", "velocity") if (run / f"{name}.pvd").exists()]
    assert fields or (run / "surface.nc").exists()
    for name in fields:
        assert [(t, file.name) for t, file in one.fields(name)] == [(t, file.name) for t, file in two.fields(name)]
    if tolerance == 0.0:
        for key in ("numerics", "counters", "highest_crest", "errors"):
            assert one.manifest[key] == two.manifest[key]
        for file in [*run.glob("*.pvd"), *run.glob("fields/*")]:
            assert file.read_bytes() == (other / file.relative_to(run)).read_bytes()
        if (run / "surface.nc").exists():
            assert one.snapshots().equals(two.snapshots())
            assert (run / "surface.xdmf").read_text().count("<Time") == len(one.snapshots().time.values)


def contents(folder: Path) -> dict[Path, bytes]:
    """Return the files of a folder."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
