"""What a run holds, taken back by another: it goes on bit for bit as the run that was not interrupted (the oracle).

Gauges, energies, counters, the state and all that is remembered are compared, the last so that nothing is left out by
which a later step could differ. What is held goes through JSON, its arrays apart, as through a file.
"""

import json
import traceback
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import asdict, dataclass, replace
from functools import reduce
from operator import getitem

import numpy as np
import pytest
from mpi4py import MPI
from ranks import Crew

from examples.paper.oscillators import NonSeparable
from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError, RunError
from wavetank.base.state import deserialize, named, plain, restore_all, serialize, typed
from wavetank.case import Case
from wavetank.integrators import INTEGRATORS, Damped, Damping, GaussLegendre4
from wavetank.integrators.filtered import Filtered
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers, build_watch
from wavetank.simulation.clock import Clock
from wavetank.simulation.records import Memory, Records
from wavetank.simulation.run import Run
from wavetank.tank.dissipation import EdgePenalty

SLICE = {
    "tank": {"length": 6.0, "depth": 0.6},
    "wall": {
        "type": "piston",
        "reach": 2.0,
        "motion": {"type": "sinusoid", "paddle_amplitude": 0.05, "period": 1.6, "ramp": 0.4},
    },
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
BASIN = {
    "tank": {"type": "basin", "depth": 0.5, "layout": {"type": "rectangle", "length": 4.0, "width": 3.0}},
    "wall": {
        "type": "segmented-piston",
        "segment": 0.5,
        "reach": 1.5,
        "motion": {"type": "oblique-wave", "wave_amplitude": 0.02, "period": 1.2, "angle": 20.0},
    },
    "sponge": {"type": "end", "length": 1.5},
    "gauges": [{"x": 2.0, "y": 1.2}],
    "run": {"duration": 0.6},
    "numerics": {"cell_size": 0.5, "order": 2, "vertical_order": 2, "dt": 0.06, "tolerance": 1e-6},
}


def changed(scene: dict, **numerics: object) -> Case:
    return Case.model_validate(scene | {"numerics": scene["numerics"] | numerics})


class Observed:
    """A scene's run, with all that observes one but what only shows it."""

    def __init__(self, scene: Case, comm: MPI.Comm):
        self.run, self.waves = build_run(scene, comm)
        for one in self.run.filters:
            if isinstance(one, EdgePenalty):
                one._fast = 0.0  # acts in each step
        self.gauges, self.energy, said = Memory(), Memory(), []
        records = Records(self.gauges, self.energy, None)
        self.run.diagnostics += build_observers(scene, self.waves, records, sinks=self.run.sinks)
        self.run.diagnostics += build_watch(self.run, self.waves, said.append)

    def counters(self) -> dict[str, int]:
        return asdict(self.waves.potential.counters) | asdict(self.waves.stages.counters)


class Keeping:
    """Keeps what a run holds at one of its steps, which goes on."""

    def __init__(self, run: Run, step: int):
        self._run, self._step = run, step
        run.longest_block = 1

    def record(self, block):
        if block.step[-1] == self._step:
            self.held = through_a_file(self._run.tree())


def through_a_file(held: dict) -> dict:
    """Return what would be read of a file: JSON, and copies of arrays."""
    text, arrays = serialize(held)
    assert all(values.dtype == np.float64 for values in arrays)
    return deserialize(text, [values.copy() for values in arrays])


def leaves(held: object, name: str = "") -> dict[str, object]:
    """Return all that is held, by its path."""
    if isinstance(held, dict):
        return {path: leaf for key, value in held.items() for path, leaf in leaves(value, f"{name}/{key}").items()}
    return {name: held}


def differing(one: dict, other: dict) -> list[str]:
    """Return the names of what is not held by both, bit for bit."""
    first, second = leaves(one), leaves(other)
    return [name for name in first.keys() | second.keys() if not alike(first.get(name), second.get(name))]


def alike(one: object, other: object) -> bool:
    """Return whether both are the same numbers, or none."""
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.array_equal(one, other, equal_nan=True)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(alike, one, other))
    return json.dumps(one) == json.dumps(other)


def resumed(scene: Case, comm: MPI.Comm, *, after: int) -> tuple[Observed, dict]:
    """Return a run that takes back what an uninterrupted one has held after some steps, equal to it at the end.

    With it what was held on the way.
    """
    whole, rest = Observed(scene, comm), Observed(scene, comm)
    keeping = Keeping(whole.run, after)
    whole.run.controls.append(keeping.record)
    whole.run.execute()
    rest.run.resume(keeping.held)
    assert not differing(keeping.held, rest.run.tree())
    rest.run.execute()
    for one, other in ((whole.gauges, rest.gauges), (whole.energy, rest.energy)):
        np.testing.assert_array_equal(one.array()[after + 1 :], other.array())
    assert whole.counters() == rest.counters()
    assert not differing(whole.run.tree(), rest.run.tree())
    return rest, keeping.held


@pytest.mark.parametrize("scheme", ["simpson-4", "third-order", "stormer-verlet", "gauss-legendre-4"])
def test_a_slice_with_all_that_remembers_goes_on_bit_for_bit(scheme):
    """A piston, a sponge, the penalty, what looks for breaking: all have acted before and act after."""
    rest, held = resumed(changed(SLICE, integrator=scheme, edge_penalty=0.25), MPI.COMM_SELF, after=4)
    before = {name.split("/")[-2]: value for name, value in leaves(held).items() if name.endswith("energy_taken")}
    breaking, penalty = (one.energy_taken for one in rest.run.sinks)
    assert penalty != before["EdgePenalty"] != 0.0 and breaking == 0.0
    sponge = [one["parts"]["EnergyBudget"]["damped"]["value"] for one in (held, rest.run.tree())]
    assert sponge[1] != sponge[0] != 0.0


@pytest.mark.parametrize(
    "scheme", [*(kind() for kind in INTEGRATORS.values()), Damped(GaussLegendre4(), Damping(np.ones(1)))]
)
def test_an_oscillator_goes_on_bit_for_bit(scheme):
    """Its stages are solved from what is extrapolated of earlier ones."""

    def run(steps):
        start = np.array([0.7]), np.array([0.2])
        return Run(NonSeparable(), Filtered(scheme, []), [], start=start, clock=Clock(0.1, steps))

    whole, first, rest = run(20), run(9), run(20)
    whole.execute()
    first.execute()
    rest.resume(through_a_file(first.tree()))
    rest.execute()
    assert not differing(whole.tree(), rest.tree())


@dataclass
class Counted:
    steps: int = 0
    rows: Vector | None = None
    mean: tuple[float, ...] = ()


class Counting:
    """A part with state."""

    def __init__(self):
        self.state = Counted()


def test_states_of_other_parts_are_refused_by_name():
    parts = named([Counting(), object(), Counting()])
    assert list(parts) == ["Counting", "Counting 2"]
    with pytest.raises(InputError, match="the state of Counting cannot be that of Counting, Counting 2"):
        restore_all(parts, {"Counting": {}})


@pytest.mark.parametrize(
    ("tree", "message"),
    [
        ({"steps": 1.5}, "part.steps = 1.5: must be of type int"),
        ({"steps": True}, "part.steps = true: must be of type int"),
        ({"rows": [1.0]}, r"part.rows = a list: must be of type None"),
        ({"mean": [1.0, "x"]}, r'part.mean\[1\] = "x": must be of type float'),
        ({"more": 1}, "part = .*: must be of type Counted"),
    ],
)
def test_a_tree_of_another_type_is_refused_with_its_path(tree, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        typed(Counted, {"steps": 1, "rows": None, "mean": []} | tree, "part")
    right = {"steps": 1, "rows": np.ones(3), "mean": [1, 2.0]}
    assert plain(typed(Counted, right, "part")) == {"steps": 1, "rows": right["rows"], "mean": [1.0, 2.0]}


MALFORMED = AttributeError, LookupError, OverflowError, TypeError, ValueError
EDITS = {
    "text": lambda value: "x",
    "null": lambda value: None,
    "NaN": lambda value: np.nan,
    "large": lambda value: 1e300,
    "negative": lambda value: -1,
    "table": lambda value: {},
    "list": lambda value: [1.0],
    "deleted": None,
    "another axis": lambda value: value[None],
    "other rows": lambda value: np.concatenate([value, value]),
    "integers": lambda value: value.astype(int),
}


def edited(tree: dict, edit: str) -> Iterator[tuple[str, dict]]:
    """Yield the tree with each of its values edited, the first of lists, and the path of the value."""
    for path, value in leaves_of_lists(tree):
        if (edit in list(EDITS)[-3:]) == isinstance(value, np.ndarray) or edit == "deleted":
            result = deepcopy(tree)
            *parents, last = path
            parent = reduce(getitem, parents, result)
            if EDITS[edit] is None:
                del parent[last]
            else:
                parent[last] = EDITS[edit](value)
            yield "/".join(map(str, path)), result


def leaves_of_lists(tree: object, path: tuple = ()) -> Iterator[tuple[tuple, object]]:
    """Yield the values of a tree with their paths, of lists the first."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree[:1]) if isinstance(tree, list) else ()
    for key, value in items:
        yield (*path, key), value
        yield from leaves_of_lists(value, (*path, key))


ABSORBING = SLICE | {"wall": SLICE["wall"] | {"absorb": {"type": "active"}}, "probes": [{"x": 2.5, "z": -0.2}]}


@pytest.fixture(scope="module")
def absorbing():
    """Return a run with an absorbing paddle, sponge, filters and probes, and its tree at the fifth step."""
    one = Observed(changed(ABSORBING, edge_penalty=0.25, cells=6, vertical_order=4), MPI.COMM_SELF)
    one.run.clock = replace(one.run.clock, steps=5)
    one.run.execute()
    return one.run, through_a_file(one.run.tree())


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("edit", EDITS)
def test_edited_state_is_refused_or_stepped(edit, absorbing):
    """No value of another type, size or shape ends in an error of a step; a run may break down by its numbers."""
    run, tree = absorbing
    count, start = 0, run.state
    for path, other in edited(tree, edit):
        run.state, run.clock = start, replace(run.clock, steps=5)
        try:
            run.resume(other)
            run.clock = replace(run.clock, steps=run.step + 1)
            run.execute()
        except (InputError, RunError, *MALFORMED) as error:  # see ``Restart.take``
            steps = [frame.name for frame in traceback.extract_tb(error.__traceback__)]
            assert isinstance(error, InputError | RunError) or "resume" in steps, path
        run.resume(deepcopy(tree))
        count += 1
    assert count > 10


# ---------------------------------------------------------------- broad


def first_half(scene: dict, after: int, numerics: dict) -> tuple:
    """Return, on each rank, what is held on the way, what there is at the end, and the gauges; collective."""
    one = Observed(changed(scene, **numerics), MPI.COMM_WORLD)
    keeping = Keeping(one.run, after)
    one.run.controls.append(keeping.record)
    one.run.execute()
    return keeping.held, one.run.tree(), one.gauges.array(), one.counters()


def second_half(scene: dict, held: list, numerics: dict) -> tuple:
    """Return what there is at the end of a run that goes on from what was held by each rank; collective."""
    one = Observed(changed(scene, **numerics), MPI.COMM_WORLD)
    one.run.resume(held[MPI.COMM_WORLD.rank])
    one.run.execute()
    return one.run.tree(), one.gauges.array(), one.counters()


def in_new_processes(function, *arguments) -> list:
    """Return what a function returns on each of two ranks that have done nothing before."""
    crew = Crew(2)
    try:
        return crew.call(function, *arguments)
    finally:
        crew.end()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["simpson-4", "third-order", "stormer-verlet", "gauss-legendre-4"])
@pytest.mark.parametrize(
    "scene",
    [BASIN, BASIN | {"water": {"type": "linear"}, "wall": {"type": "fixed"}}, SLICE],
    ids=["basin", "linear", "slice"],
)
def test_two_ranks_go_on_bit_for_bit_in_other_processes(scene, scheme):
    numerics = {"integrator": scheme}
    whole = in_new_processes(first_half, scene, 4, numerics)
    ended = in_new_processes(second_half, scene, [held for held, *_ in whole], numerics)
    for (_, end, gauges, counters), (its_end, its_gauges, its_counters) in zip(whole, ended, strict=True):
        assert not differing(end, its_end)
        np.testing.assert_array_equal(gauges[5:], its_gauges)
        assert counters == its_counters
