"""Implicit smoothing of the water's state: symmetric, exactly mass-conserving, its energy counted."""

from collections.abc import Callable
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import ufl

from wavetank.arrays import Vector
from wavetank.fem.mass import FactoredMatrix, FactoredSmoothing, HorizontalMatrix, RaisedSmoothing
from wavetank.stateful import Held
from wavetank.tank.walls.contract import Columns
from wavetank.tank.waves import NonlinearWaves


class Smoother(Protocol):
    """N, and what is done with it: see ``Smoothing``; values are owned, shape (owned,), and all of it is collective."""

    def update(self) -> None:
        """Take over M_J and N as they are."""

    def apply(self, values: Vector) -> Vector:
        """Return N v."""

    def smoothed(self, pairs: Vector, still: Vector | float) -> Vector:
        """Return Q - N eta' and psi' of points [Q, psi], shape (m, 2, owned), over columns of still water [m]."""


class Solved(Protocol):
    """N, and what (M_J + N)^-1 finds; values are owned, shape (owned,), and all of it is collective."""

    def update(self) -> None:
        """Take over M_J and N as they are."""

    def apply(self, values: Vector) -> Vector:
        """Return N v."""

    def taken(self, values: Vector, start: Vector) -> Vector:
        """Return v - v', found from a start value."""

    def moved(self, values: Vector, taken: Vector) -> Vector:
        """Return N v' of what is taken of v; its sum is 0 to round-off."""


class OneByOne:
    """A smoother that finds what it takes of each field of a point by itself, from what it has taken of the last.

    The points of a state are close to each other.
    """

    def __init__(self, solved: Solved, columns: Columns):
        self._solved, self._columns = solved, columns
        self.update, self.apply = solved.update, solved.apply

    def smoothed(self, pairs: Vector, still: Vector | float) -> Vector:
        """See ``Smoother``."""
        found, solved = np.empty_like(pairs), self._solved
        of_eta = of_psi = np.zeros(pairs.shape[2:])
        for (q, psi), after in zip(pairs, found, strict=True):
            eta = self._columns.solve(q) - still
            of_eta, of_psi = solved.taken(eta, of_eta), solved.taken(psi, of_psi)
            after[:] = q - solved.moved(eta, of_eta), psi - of_psi
        return found


class Smoothing:
    """v' = (M_J + N)^-1 M_J v for the elevation eta and the surface potential psi, N symmetric with zero row sums.

    It is the elevation that is smoothed, not the column: still water over any bed stays still.

    Parameters
    ----------
    waves
        The water.
    form
        The bilinear form of N in UFL, given trial and test function.
    by_wall
        Whether nothing but the wall changes it.

    Attributes
    ----------
    energy_taken
        So far [m^4/s²].
    called, gives
        In words, what it is, and what makes it give energy instead.
    """

    called = "smoothing"
    gives = "waves too short or too steep for the step and the cells make it do so"

    def __init__(self, waves: NonlinearWaves, form: Callable[[Any, Any], ufl.Form], *, by_wall: bool = False):
        self._waves, self._of, self._by_wall = waves, form, by_wall
        self.energy_taken = 0.0

    @cached_property
    def _smoother(self) -> Smoother:
        """N, and what is done with it, made where it is first needed; collective."""
        return self._made()

    def _made(self) -> Smoother:
        """Return it of the form; collective."""
        plane, mass, J = self._waves.plane, self._waves.mass, self._waves.wall.mapping.J(self._waves.densities.eta)
        if plane.mesh.topology.dim == 1 and plane.comm.size == 1:
            wall = self._waves.wall
            changing = plane.around(wall.carries) if self._by_wall and wall.moves else None
            whole = FactoredMatrix(plane, lambda u, v: J * u * v * plane.dx + self._of(u, v), changing=changing)
            return OneByOne(FactoredSmoothing(whole, mass), self._waves.columns)
        return OneByOne(RaisedSmoothing(mass, HorizontalMatrix(plane, self._of), plane), self._waves.columns)

    def update(self) -> None:
        """Assemble N for the present values of what its form depends on, the wall among them; collective."""
        self._smoother.update()

    def passed(self, pairs: Vector) -> Vector:
        """Return Q - N eta', whose sum, the mass, is that of Q, and psi' of points [Q, psi], shape (m, 2, owned)."""
        return self._smoother.smoothed(pairs, self._waves.bed.still)

    def account(self, taken: float, *, of: float) -> None:
        """Add what has been taken."""
        self.energy_taken += taken

    def held(self) -> Held:
        """Return what has been taken."""
        return {"energy_taken": self.energy_taken}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self.energy_taken = held["energy_taken"]
