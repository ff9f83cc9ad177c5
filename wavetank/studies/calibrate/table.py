"""What a calibration has tried: a row for each attempt."""

import csv
from collections.abc import Sequence
from io import StringIO
from pathlib import Path

import numpy as np

from wavetank.errors import RecordError
from wavetank.output.files import write_atomically
from wavetank.studies.calibrate.aim import Tried

COLUMNS = (
    *("attempt", "runs", "numerics", "crest [m]", "x [m]", "t [s]", "nrms", "misfit over allowed"),
    *("waves that broke", "CPU [s]", "cause"),
)


def figures(misfit: float) -> str:
    """Return a misfit to two figures, large ones to all before the point."""
    return f"{misfit:.2g}" if misfit < 10 else f"{misfit:.0f}"


def told(one: Tried) -> str:
    """Return what is said of an attempt while others are to come."""
    found = one.found
    if one.cause:
        return one.cause
    broke = f"; waves break {one.broke} times" if one.broke > 1 else "; a wave breaks" if one.broke else ""
    other = found.rival
    rival = f"; another of {other.height:.4g} m at {other.x:.4g} m, {other.t:.4g} s" if other else ""
    nrms = "" if np.isnan(found.nrms) else f"nrms {found.nrms:.3g}, "
    return (
        f"crest {found.crest:.4g} m at x = {found.x:.4g} m, t = {found.t:.4g} s{rival}; {nrms}misfit "
        f"{figures(found.misfit)} of what is allowed{broke}; {one.cpu:.1f} s of CPU time with {one.numerics} numerics"
    )


def write_table(path: Path, tried: Sequence[Tried]) -> None:
    """Write ``calibration.csv``, in one step; raise ``RecordError``."""
    text = StringIO()
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for one in tried:
        found = one.found
        values = [found.crest, found.x, found.t, found.nrms, found.misfit]
        shown = [f"{value:.6g}" if np.isfinite(value) else "" for value in values]
        writer.writerow([one.number, one.runs, one.numerics, *shown, one.broke, f"{one.cpu:.3g}", one.cause])
    try:
        write_atomically(path, text.getvalue().encode())
    except OSError as error:
        raise RecordError(f"{path}: cannot be written ({error.strerror}).") from None
