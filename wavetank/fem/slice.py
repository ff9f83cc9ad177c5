"""Potentials along a slice or ring, all of it on this rank, found as a whole (``slice.c``).

A solve is a dozen calls of compiled functions, and what Python takes between these is as much as what they take. Here
they follow each other in C, on the arrays of the objects that they are of. What is not as usual is left to these: the
first solve, a new preconditioner, water that is none.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.along import Minimum
from wavetank.fem.anderson import AndersonMixing
from wavetank.fem.codegen import Buffer, Function, Struct, Unit, source
from wavetank.fem.initial_guess import InitialGuessProjection
from wavetank.fem.layers import LayerOperator
from wavetank.fem.mass import BandedMass, MassMatrix
from wavetank.fem.plane import Field, LayeredField, Plane

EXPORTS = "begin_stage", "attempt", "evaluate", "precondition", "set_velocity"


class WallStruct(Protocol):
    """A wall's part of the energy of a slice, compiled.

    Attributes
    ----------
    prefix, struct
        Of its functions in the unit, and what they are called with.
    by_potential
        dW/dphi, as its function sets it, shape (dofs, n+1).
    """

    prefix: str
    struct: Struct
    by_potential_rows: Vector

    def follow(self) -> None:
        """Take over the bed as it is."""


class Inverse(Protocol):
    """The inverse of a stage's residual, nearly.

    Attributes
    ----------
    struct
        The ``Advection`` that it is called with.
    carried
        Whether it takes account of the current.
    """

    struct: Struct
    carried: bool


class Near(Protocol):
    """A point z, and f there, next to where z = c + a f(z), of known c; shape (2 dofs,) each."""

    @property
    def known(self) -> Vector:
        """See above."""

    @property
    def z(self) -> Vector:
        """See above."""

    @property
    def slope(self) -> Vector:
        """See above."""


class Leaning(Protocol):
    """What finds columns from masses, and their potential energy, beside a paddle that leans.

    Attributes
    ----------
    mean, column
        The mass matrix with the mean of J over the column, and that column, shape (dofs,) [m].
    trials, round_off
        How many there are at most, and of the columns what they are found to.
    """

    mean: MassMatrix
    column: Vector
    trials: int
    round_off: float


class Solution:
    """What has been found.

    Attributes
    ----------
    iterations
        That it took.
    level
        The mean of the surface potential, which is left out.
    kinetic
        phi A phi.
    square
        The sum of the squares of elevation, and of potential over celerity.
    energies
        Potential energy, the walls' part of H, and their power; None where these are not computed.
    rows
        (A phi)_n less its mean, and the wall's; the negative of M^-1 of the derivative of the energy by the column, the
        wall's included, and that; masses and surface potential that it is of: shape (5, dofs).
    """

    __slots__ = "energies", "iterations", "kinetic", "level", "rows", "square"

    def __init__(self, iterations: int, rows: Vector, numbers: Sequence[float]):
        self.level, self.kinetic, self.square, *energies = numbers
        self.iterations, self.rows = iterations, rows
        self.energies = energies or None


class SliceSolver:
    """Finds potentials of column masses and surface potentials.

    Parameters
    ----------
    unit
        That of all components; no instance is added to it after this one.
    mass, potential, operator, minimum, recall
        What is called; ``potential`` integrates the potential energy.
    column, phi
        Where column and potential are found.
    walls, leaning
        Of those that move, none to two, and of such as lean.
    carried
        The degrees of freedom at which walls add something.
    inputs
        Numbers by which start values are found: elevation, potential over ``celerity`` [m/s], which are set here, and
        what tells how walls move.
    """

    def __init__(
        self,
        plane: Plane,
        unit: Unit,
        *,
        mass: BandedMass,
        potential: MassMatrix,
        operator: LayerOperator,
        minimum: Minimum,
        recall: InitialGuessProjection,
        column: Field,
        phi: LayeredField,
        walls: Sequence[WallStruct],
        carried: NDArray[np.int32],
        leaning: Leaning | None,
        inputs: Vector,
        celerity: float,
    ):
        self._mass, self._minimum, self._recall, self._walls = mass, minimum, recall, walls
        self._n, numbers = plane.size, phi.rows.shape[1]
        self.instance = unit.add(
            "",
            source("slice.c"),
            exports=EXPORTS,
            sizes={
                "NUMBERS": numbers,
                "FIELDS": operator.density.fields,
                "LEANS": int(leaning is not None),
                "EACH_WALL(f)": " ".join(f"f({wall.prefix}, {k})" for k, wall in enumerate(walls)),
            },
        )
        shape, of_walls = phi.rows.shape, [wall.by_potential_rows for wall in walls] or [np.zeros((1, numbers))]
        lean: dict[str, Any] = {}
        if leaning:
            lean = {"mean": leaning.mean.struct, "mean_column": leaning.column}
            lean |= {name: np.empty_like(leaning.column) for name in ("before", "change")}
            lean |= {"trials": leaning.trials, "round_off": leaning.round_off}
        self._tank = self.instance.struct(
            "Tank",
            dofs=plane.size,
            celerity=celerity,
            mass=mass.struct,
            potential=potential.struct,
            cells=operator.cells,
            layers=operator.layers,
            rows=operator.rows,
            guesses=recall.struct,
            walls_moving=len(walls),
            walls=[wall.struct for wall in walls],
            wall=of_walls[0] if len(of_walls) == 1 else np.zeros(shape),
            carries=len(carried),
            carried=carried,
            fields=operator.density.values,
            column=column.rows,
            phi=phi.rows,
            image=np.zeros(shape),
            inputs=inputs,
            **minimum.compiled,
            **lean,
        )
        self._numbers, self._energies = np.zeros(3), np.zeros(6)  # of a solution, without and with energies
        n, result, function = Buffer(plane.size), Buffer(5 * plane.size), self.instance.function
        self._evaluate = function("evaluate", self._tank, n, n, n, int, result, self._energies)
        self._still: tuple[Vector | float, Vector] = np.nan, np.empty(0)  # that, spread
        self._trials: dict[tuple[Inverse, AndersonMixing], tuple[Any, Function, Function]] = {}

    def _spread(self, still: Vector | float) -> Vector:
        """Return the column of still water at all degrees of freedom."""
        if still is not self._still[0]:
            self._still = still, np.broadcast_to(still, self._n).astype(np.float64)
        return self._still[1]

    def evaluate(self, q: Vector, p: Vector, still: Vector | float) -> Solution | None:
        """Return what belongs to masses q and surface potential p, (dofs,) each, or None of what is not as usual.

        It comes with energies.

        ``still`` is the column of still water [m].
        """
        recorded = self._ready()
        if not recorded:
            return None
        for wall in self._walls:
            wall.follow()
        result = np.empty((5, p.size))
        iterations = self._evaluate(q, p, self._spread(still), recorded, result)
        return self._solution(iterations, result, self._energies)

    def attempt(
        self,
        z: Vector,
        known: Vector,
        still: Vector | float,
        *,
        weight: float,
        inverse: Inverse,
        mixing: AndersonMixing,
    ) -> tuple[Solution, tuple[Vector, float, float]] | None:
        """Return what belongs to a point z = [q, p] of a stage z = c + a f(z), and where it leads; or None.

        ``known`` is c, ``weight`` a [s]. It leads to where ``mixing`` takes points by their residuals, of which the
        ``inverse`` is taken; what is left of these there comes then, and last z itself, as roots of squares, scaled.
        """
        recorded, mixed, size = self._ready(), mixing.recorded, z.size // 2
        if not recorded:
            return None
        result, following = np.empty((5, size)), np.empty_like(z)
        trial, attempt, _ = self._trial(inverse, mixing)
        iterations = attempt(z, known, weight, inverse.carried, self._spread(still), recorded, mixed, result, following)
        solution = self._solution(iterations, result, self._numbers)
        if solution is None:
            return None
        mixing.recorded += 1
        return solution, (following, trial.c.away, trial.c.length)

    def begin_stage(
        self, near: Near, *, weight: float, wrong: float, inverse: Inverse, among: AndersonMixing
    ) -> Vector:
        """Return where to begin a stage z = c + a f(z), from what is known near its solution.

        That is where ``among`` combines points by their c, which are ``wrong`` by so much, with the ``inverse`` of what
        is missed of c; a point that is near takes part from now on.
        """
        self._mass.make_ready()
        start = np.empty_like(near.z)
        *_, begin = self._trial(inverse, among)
        begin(near.z, near.slope, near.known, weight, inverse.carried, among.recorded, wrong, start)
        among.recorded += 1
        return start

    def _ready(self) -> int:
        """Make ready for a potential; return how many are known."""
        self._mass.make_ready()
        return self._recall.recorded

    def _solution(self, iterations: int, found: Vector, numbers: Vector) -> Solution | None:
        """Return what has been found, which is recorded; None of what is not as usual."""
        if iterations < 0:
            return None
        self._recall.recorded += 1
        self._minimum.last = self._tank.c.iterations
        return Solution(iterations, found, [*map(float, numbers)])

    def _trial(self, inverse: Inverse, mixing: AndersonMixing) -> tuple[Struct, Function, Function]:
        """Return what attempts are made with, made once for an inverse and a mixing, which live as long as this."""
        trial = self._trials.get((inverse, mixing))
        if trial is None:
            struct, function = self.instance.struct, self.instance.function
            room = {name: np.zeros(2 * self._n) for name in ("residual", "image", "nothing", "missed")}
            mixed = struct("Mixing", **mixing.compiled)
            stage = struct("Stage", tank=self._tank, advection=inverse.struct, mixing=mixed, **room)
            n, z, result = Buffer(self._n), Buffer(2 * self._n), Buffer(5 * self._n)
            attempt = function("attempt", stage, z, z, float, int, n, int, int, result, self._numbers, z)
            begin = function("begin_stage", stage, z, z, z, float, int, int, float, z)
            self._trials[inverse, mixing] = trial = stage, attempt, begin
        return trial
