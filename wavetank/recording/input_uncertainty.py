"""The effect of the uncertainty of a recorded paddle motion on the gauges of a run, by linear runs in memory."""

import hashlib
from collections.abc import Iterator
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mpi4py import MPI
from xarray import DataArray, zeros_like

from wavetank.base.arrays import Vector
from wavetank.base.case_model import CaseError
from wavetank.base.errors import InputError
from wavetank.base.files import regular
from wavetank.case import Case, StillWater
from wavetank.case.model import LinearWater
from wavetank.case.paddle import AtRestMotion, RecordedMotion
from wavetank.data import Dataset
from wavetank.data.description import DATASET, PaddleUncertainty
from wavetank.data.places import present
from wavetank.motion.recorded import read_record
from wavetank.output.directory import PADDLES, RunDirectory
from wavetank.planning.cost import check_affordable
from wavetank.planning.plan import planned
from wavetank.recording.certify import records_in_memory
from wavetank.recording.restart import stored_case

SEED = 0
LONGEST = 600.0  # largest predicted CPU time of a linear run [s]
COLUMNS = {"position": "position [m]", "velocity": "velocity [m/s]"}


def input_uncertainty(run: RunDirectory, data: Dataset) -> DataArray:
    """Return u_input [m] over gauge and time [s], the effect of the uncertainty of the records that drive paddles.

    The parts are gain S', clock dS'/dt and the rms of the response to noise. S' is the elevation that the record
    generates in linear water, with the numerics of the run. The attribute ``unstated`` lists the parts that the data do
    not state, e.g. ``gain of paddle.csv``. Raises ``InputError`` if no record of the run is one of
    the data with an uncertainty, if its case cannot be read or needs more than ``LONGEST``, and ``UntrustedError``
    before the execution of a Python file.
    """
    checksums, squares = run.manifest.get("files", {}), list[DataArray]()
    paths = {one: present(data, one.file) for one in data.paddle}
    uncertain = {_checksum(path): (one, path) for one, path in paths.items() if path and one.stated}
    driven = [
        (wall, key, *uncertain[checksum])
        for wall in PADDLES
        for key in COLUMNS
        if (checksum := checksums.get(f"{wall}.motion.{key}")) in uncertain
    ]
    if not driven:
        if missing := [one.file for one, path in paths.items() if not path]:
            raise InputError(f"{data.folder / DATASET}: paddle.file {', '.join(missing)}: no such file")
        raise InputError("the paddle of the run is not driven by a record whose uncertainty the data state")
    case = linear_case(planned(stored_case(run.path), MPI.COMM_SELF).case)
    try:
        check_affordable(case, MPI.COMM_SELF, longest=LONGEST)
    except CaseError:
        raise InputError(f"a linear run needs more than {LONGEST:g} s, or more memory than is available") from None
    for wall, key, stated, path in driven:
        squares += [part**2 for part in _parts(case, wall, key, stated, path)]
    total: DataArray = sum(squares) ** 0.5
    unstated = [f"{name} of {stated.file}" for *_, stated, _ in driven for name in stated.unstated]
    return total.assign_attrs(unstated=list(dict.fromkeys(unstated)))


def _checksum(path: Path) -> str:
    with regular(path, largest=inf).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def linear_case(case: Case) -> Case:
    """Return a case with all numerics in linear water that is at rest initially, with the records of gauges."""
    output = {"velocity_every": None, "surface_every": case.run.duration}
    changes = {"water": LinearWater(), "initial": StillWater(), "probes": (), "loads": (), "windows": ()}
    return case.model_copy(update=changes | {"output": case.output.model_copy(update=output)})


def response(case: Case, wall: str, motion: RecordedMotion) -> DataArray:
    """Return the elevation [m] at the gauges of a case over gauge and time, with a motion of one wall only."""
    walls: dict[str, Any] = {
        end.key: end.wall.model_copy(update={"motion": motion if end.key == wall else AtRestMotion()})
        for end in case.paddles
    }
    records = records_in_memory(case.model_copy(update=walls), MPI.COMM_SELF, lambda block: None)
    eta: DataArray = records.gauges.elevation
    return eta


def _parts(case: Case, wall: str, key: str, stated: PaddleUncertainty, path: Path) -> Iterator[DataArray]:
    """Yield the stated parts of u_input [m] over gauge and time, of the record of one wall."""
    motion: RecordedMotion = getattr(case, wall).motion.model_copy(update={key: str(path)})
    sizes: dict[str, Any] = stated.stated
    if sizes.keys() & {"gain", "clock"}:
        eta = response(case, wall, motion)
        yield sizes.get("gain", 0.0) * eta
        yield sizes.get("clock", 0.0) * eta.differentiate("time")
    if "noise" in sizes:
        with TemporaryDirectory() as folder:
            noisy = Path(folder) / "noise.txt"
            t = read_record(path, column=COLUMNS[key], named=motion.column)[0]
            np.savetxt(noisy, np.column_stack([t, noise(sizes["noise"], t.size)]))
            eta = response(case, wall, motion.model_copy(update={key: str(noisy), "column": None}))
        yield zeros_like(eta) + (eta**2).mean("time") ** 0.5


def noise(size: float, count: int) -> Vector:
    """Return independent normal values of a standard deviation, always the same ones."""
    return size * np.random.default_rng(SEED).standard_normal(count)
