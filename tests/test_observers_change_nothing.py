"""A run with every kind of record equals the run without, bit for bit: no observer changes the waves."""

from pathlib import Path

import pytest
from test_state import BASIN, FLAP, RING, SLICE

import wavetank as wt
from wavetank.case import Case
from wavetank.output.directory import FIELDS, RunDirectory
from wavetank.simulation.clock import EverySteps

ALONG = {
    "probes": [{"x": 1.6, "z": -0.2}],
    "windows": [{"name": "middle", "start": [1.5, 0.0], "columns": 1, "levels": 3, "every": 0.05}],
    "output": {"velocity_every": 0.05},
}
ON_WALLS = {"loads": [{"on": "paddle"}, {"on": "far wall"}]}
LINEAR = {"water": {"type": "linear"}, "output": {}}
CASES = {  # the case, and its records
    "slice": (SLICE, ALONG | ON_WALLS),
    "linear": (SLICE | LINEAR, ALONG | ON_WALLS | {"output": {}}),
    "flap": (FLAP, ALONG | ON_WALLS),
    "ring": (RING, ALONG),
    "basin": (BASIN, ALONG | ON_WALLS),
}


class Evaluating:
    """A user's observer, which evaluates the waves at the moment and at another state."""

    def __init__(self, waves):
        self._waves, self.schedule = waves, EverySteps()

    def record(self, block):
        for q, psi, t in block.states():
            self._waves.elevation(q, psi, t)
            self._waves.energies(q, psi, t)
            self._waves.evaluate(q, 1.1 * psi, t)
            for p in (psi, 0.9 * psi):
                self._waves.H_p(q, p, t)
                self._waves.H_q(q, p, t)


class Looking(Evaluating):
    """A user's observer that asks for the elevation only."""

    def record(self, block):
        for state in block.states():
            self._waves.elevation(*state)


def surfaces(run: RunDirectory) -> bytes:
    """Return all that a run has recorded of its surface."""
    if pieces := sorted((run.path / FIELDS).glob("surface*.vtu")):
        return b"".join(piece.read_bytes() for piece in pieces)
    surface = run.snapshots()
    return b"".join(surface[name].values.tobytes() for name in ("time", "elevation", "surface_potential"))


@pytest.mark.parametrize("name", CASES)
def test_a_run_with_every_record_and_a_users_observer_equals_the_run_without(name: str, tmp_path: Path):
    case, records = CASES[name]
    plain = {key: value for key, value in case.items() if key != "gauges"}
    scenes = {"without": plain, "with": case | records}
    every = {"surface_every": 0.05}
    without, observed = (
        wt.run(
            Case.model_validate(scene | {"output": scene.get("output", {}) | every}),
            tmp_path / which,
            observers=[Evaluating, Looking] if which == "with" else [],
            quiet=True,
        )
        for which, scene in scenes.items()
    )
    assert len(surfaces(without)) > 1000
    assert surfaces(observed) == surfaces(without)
    assert observed.manifest["counters"] == without.manifest["counters"]
    assert not observed.gauges.isnull().any() and (tmp_path / "with" / "probes.csv").exists()
    assert (tmp_path / "with" / "velocity.pvd").exists() == (name != "linear")
