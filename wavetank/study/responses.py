"""What the water does in a run, as a study tables it: the highest crest and the deepest trough of all its snapshots."""

from collections.abc import Iterable

import numpy as np

from wavetank.records.directory import RunDirectory

CREST, CREST_PLACE, CREST_TIME = "highest crest [m]", "crest's place x [m]", "crest's time [s]"
TROUGH = "deepest trough [m]"
Responses = dict[str, float]


def responses(run: RunDirectory) -> Responses:
    """Return the highest elevation, where and when it stood, and the lowest, by the names above."""
    surface = run.snapshots()
    snapshot, point = np.unravel_index(np.argmax(surface.eta), surface.eta.shape)
    return {
        CREST: float(surface.eta.max()),
        CREST_PLACE: float(surface.x[snapshot, point]),
        CREST_TIME: float(surface.t[snapshot]),
        TROUGH: float(surface.eta.min()),
    }


def responded(found: Iterable[Responses]) -> list[str]:
    """Return the responses that any run has."""
    return list(dict.fromkeys(name for one in found for name in one))
