"""An initial surface that another run has come to."""

from typing import Literal

from pydantic import Field

from wavetank.values.noun import FilePath, Noun


class RunState(Noun):
    """The surface of another run of the same tank, as a checkpoint of it keeps it, also on other cells.

    This run's time begins at 0. Numerics that are not named are those of that run.
    """

    type: Literal["run"] = "run"
    directory: FilePath = Field(description="run directory of that run")
    t: float | None = Field(
        default=None, ge=0.0, le=1e9, description="time of that run [s], of which it keeps two; default: its last"
    )
