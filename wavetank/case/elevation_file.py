"""The record of a gauge, which a paddle reproduces or a calibration approximates."""

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field

from wavetank import data
from wavetank.base.case_model import CaseError, CaseModel, FilePath, Problem, about
from wavetank.base.quantities import Frequency, Label, Time
from wavetank.motion import Array
from wavetank.motion.recorded import ELEVATION, TIME, check_rows, read_record
from wavetank.waves.measured import TargetElevation

RecordFile = Annotated[FilePath, BeforeValidator(lambda name: f"data:{name}" if name in data.names() else name)]


class ElevationFile(CaseModel):
    """The elevation at a gauge in a table or a data set, as in `wavetank compare`, and the frequencies of its waves."""

    file: RecordFile = Field(
        description="table of t and eta, or of t and gauges with their names in its first line, or a data set, as in "
        "compare"
    )
    gauge: Label | None = Field(default=None, description="name of the gauge in the file; default: its only record")
    delay: Time = Field(default=0.0, description="added to the times of the file [s]")
    lowest_frequency: Frequency | None = Field(
        default=None, description="lowest generated frequency [Hz]; default a quarter of the mean"
    )
    highest_frequency: Frequency | None = Field(
        default=None,
        description="highest generated frequency [Hz]; default that of the waves above the background of the "
        "spectrum, at most four times the mean",
    )

    def generated_band(self, waves: TargetElevation) -> str:
        """Return the frequencies that are generated of the record, and the key of a limit that is by default."""
        f = waves.frequencies
        note = f"waves of {f[0]:.3g} to {f[-1]:.3g} Hz of the record are generated"
        return note if self.highest_frequency else f"{note}; highest_frequency replaces the limit of its spectrum"

    def record(self, *key: str) -> tuple[Array, Array]:
        """Return delayed times [s] and elevations [m], shape (N,) each.

        Raises ``CaseError`` at a key if the file cannot be read or has no such gauge.
        """
        with about(*key, "file", received=self.file):
            reference = self.file.removeprefix("data:")
            if reference == self.file or "/" in reference:
                path = data.resolve(self.file)
                if self.gauge is None and not path.is_dir() and _has_elevation(path):
                    t, eta = read_record(path, column=ELEVATION)
                    return t + self.delay, eta
                reference = str(path)
            records = data.gauge_records(data.opened(reference))[0]
            names = [str(name) for name in records.gauge.values]
            gauge = names[0] if self.gauge is None and len(names) == 1 else self.gauge
            if gauge not in names:
                allowed = f"must be a gauge of {self.file}: {', '.join(names)}"
                if other := data.other_columns(reference).get(gauge or ""):
                    allowed += f"; {other} is no elevation"
                raise CaseError([Problem((*key, "gauge"), gauge, allowed)])
            one = records.sel(gauge=gauge).dropna("time")
            check_rows(self.file, one.size)
        return np.asarray(one.time.values + self.delay), np.asarray(one.values)


def _has_elevation(path: Path) -> bool:
    """Return whether a table has two columns without names, or a column with the name of the elevation."""
    names = data.gauges_header(path).names
    return not names or {TIME, ELEVATION} <= {*names}
