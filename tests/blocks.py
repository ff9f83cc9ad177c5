"""Blocks of reported states for tests of diagnostics."""

from typing import Any

from wavetank.simulation.run import Rows
from wavetank.tank.block import Block


def block_of(system: Any, *states: tuple[int, float, Any], sinks: Any = (), work: Any = None) -> Block:
    """Return the block of states (step, t, state of the integrator), as a run records them; collective."""
    size = states[0][2].q.size
    rows = Rows(system, size, len(states), sinks=sinks, work=work)
    for step, t, state in states:
        rows.write(state, step, t)
    block = rows.take(states[-1][2], 1.0)
    assert block is not None
    return block


def empty_block(waves: Any, most: int) -> Block:
    """Return memory for a block of states of waves."""
    wall = waves.wall
    return Block.empty(most, owned=waves.plane.owned, paddles=len(wall.rates), velocities=wall.velocities.size)


def at(step: int, t: float) -> Block:
    """Return the block of a step of which nothing else matters."""
    block = Block.empty(1, owned=1)
    block.step[:], block.t[:] = step, t
    return block
