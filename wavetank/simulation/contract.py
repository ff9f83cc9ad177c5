"""The interface of a diagnostic, and displacements of the paddles at the steps of a block."""

from typing import Protocol

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.simulation.clock import EverySteps, Schedule
from wavetank.tank.block import Block
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.walls import Wall
from wavetank.tank.waves import NonlinearWaves


class Diagnostic(Protocol):
    """A record of blocks of reported states, at the steps of a schedule."""

    @property
    def schedule(self) -> Schedule:
        """The recorded steps."""

    def record(self, block: Block) -> None:
        """Record the due steps of a block, at least one; collective.

        The record of a step must not depend on other steps of its block. Raises ``RunError`` with the time of the step
        at which the run ends: other diagnostics then record the steps up to that one.
        """


Waves = NonlinearWaves | LinearWaves


def due_steps(schedule: Schedule, block: Block) -> Block:
    """Return the steps of a block that are due by a schedule."""
    if schedule == EverySteps():
        return block
    due = schedule.due(block.step, block.t, block.t - block.dt)
    return block.at(np.broadcast_to(due, block.step.shape))


def displacement(block: Block, number: int, wall: Wall, places: Vector) -> Vector:
    """Return the displacement of paddles at places [m] at one step of a block, shape (paddles, N)."""
    return wall.paddle_displacements(places, float(block.t[number]), block.rates[number, :, 0])


def displacements(block: Block, wall: Wall, places: Vector) -> Vector:
    """Return the displacements of paddles at places [m] at all steps of a block, shape (paddles, K, N); collective."""
    return wall.displacements_at(places, block.t, block.rates[:, :, 0])
