"""Reads components of waves: text files with a row for each."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wavetank.errors import InputError
from wavetank.motion.motion import Array
from wavetank.values.columns import read_columns

MOST = 10_000


class Components(NamedTuple):
    """Waves by their frequencies [Hz], amplitudes [m], phases [rad] and angles to x [rad], shape (N,) each."""

    frequencies: Array
    amplitudes: Array
    phases: Array
    angles: Array


def read_components(path: Path, columns: Sequence[str]) -> Components:
    """Return the components that are not 0; angles are 0 where no column has them.

    Parameters
    ----------
    path
        The file.
    columns
        What is in its columns: "frequency" [Hz] or "omega" [rad/s], "amplitude", "phase" or "lag", its
        opposite, "direction" [deg], and what else there is.

    Raises ``InputError`` naming the file and the line if it cannot be read, if a row is not that many finite numbers,
    if a frequency is not positive, or where no component is left, or more than ``MOST``.
    """
    allowed = f"allowed are {len(columns)} finite numbers: {', '.join(columns)}"
    _, values, lines = read_columns(path, columns=len(columns), allowed=allowed)
    by_name = dict(zip(columns, values.T, strict=True))
    f = by_name["frequency"] if "frequency" in by_name else by_name["omega"] / (2.0 * np.pi)
    for one, line in zip(f, lines, strict=True):
        if not 1e-6 <= one <= 1e6:
            raise InputError(f"{path}, line {line}: a frequency of {one:g} Hz received; allowed are 1e-6 to 1e6.")
    kept = by_name["amplitude"] != 0.0
    if not 0 < kept.sum() <= MOST:
        raise InputError(f"{path}: {kept.sum()} components received; allowed are 1 to {MOST}.")
    phase = by_name["phase"] if "phase" in by_name else -by_name["lag"]
    angles = np.radians(by_name.get("direction", 0.0 * f))
    for one, line in zip(angles, lines, strict=True):
        if not abs(one) < np.pi / 2:
            received = f"a direction of {np.degrees(one):g} deg received"
            raise InputError(f"{path}, line {line}: {received}; allowed are more than -90 and less than 90.")
    return Components(f[kept], by_name["amplitude"][kept], phase[kept], angles[kept])
