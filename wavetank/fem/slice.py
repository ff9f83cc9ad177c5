"""Evaluations and implicit stages of a slice or ring on one rank, each as one compiled call (``slice.c``).

An evaluation consists of a dozen compiled functions. Python between them would cost as much as they do. The C code uses
the arrays of the Python objects. The Python objects do the rest: the first solve, a new preconditioner, and solves that
fail, so that one place reports the cause.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.fem.anderson import AndersonMixing
from wavetank.fem.codegen import Buffer, Function, Struct, Unit, source
from wavetank.fem.layers import LayerOperator
from wavetank.fem.mass import BandedMass, MassMatrix
from wavetank.fem.plane import Field, LayeredField, Plane

EXPORTS = "displace", "evaluate", "solve_stage", "elevation_change", "precondition", "set_velocity"


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


class Solution(NamedTuple):
    """The interior potential's solution at a state, and the derivatives of H there.

    Attributes
    ----------
    rows
        dH/dpsi; -dH/dQ; M^-1 dH/dh; Q; psi; the elevation: shape (6, dofs).
    level
        The mean of the surface potential, which the potential omits.
    kinetic
        phi A phi.
    square
        The sum of the squares of elevation, and of potential over celerity.
    energies
        Potential energy, the walls' part of H, and their power; empty where these are not computed.
    """

    rows: Vector
    level: float
    kinetic: float
    square: float
    energies: Sequence[float] = ()


class StageResult(NamedTuple):
    """The result of a compiled stage.

    Attributes
    ----------
    z
        The solution, or where it does not converge a start value for another solver; shape (2, dofs).
    history_size
        The size by which the tolerance is scaled, as ``StageHistory`` has it.
    size
        The size of the last iterate.
    contraction
        The contraction of the first iteration, if there were two; else nan.
    evaluations
        Of f.
    """

    z: Vector
    solved: bool
    history_size: float
    size: float
    contraction: float
    evaluations: int


class SliceSolver:
    """Finds potentials of column masses and surface potentials.

    Parameters
    ----------
    unit
        That of all components; no instance is added to it after this one.
    mass, potential, operator, interior
        What is called; ``potential`` integrates the potential energy, ``interior`` is an ``InteriorPotential``.
    column, phi
        Where column and potential are found.
    walls, leaning
        Of those that move, none to two, and of such as lean.
    on_varying_bed
        Whether the depth beside walls depends on time.
    carried
        The degrees of freedom at which walls add something.
    inputs
        Numbers by which start values are found: elevation, potential over ``celerity`` [m/s], which are set here, and
        what tells how walls move.
    scales, position
        Of the velocities of the walls among the inputs, shape (walls, dofs); the displacement of the mesh by two walls.

    Attributes
    ----------
    displace
        Moves the walls to where their ``moves`` are, with the mass matrix and the inputs.
    """

    def __init__(
        self,
        plane: Plane,
        unit: Unit,
        *,
        mass: BandedMass,
        potential: MassMatrix,
        operator: LayerOperator,
        interior: Any,
        column: Field,
        phi: LayeredField,
        walls: Sequence[WallStruct],
        on_varying_bed: bool,
        carried: NDArray[np.int32],
        leaning: Leaning | None,
        inputs: Vector,
        celerity: float,
        scales: Vector,
        position: Vector | None,
    ):
        self._interior, self._following = interior, walls if on_varying_bed else ()
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
        self.struct = self.instance.struct(
            "Tank",
            dofs=plane.size,
            celerity=celerity,
            mass=mass.struct,
            potential=potential.struct,
            cells=operator.cells,
            layers=operator.layers,
            rows=operator.rows,
            guesses=interior.recall.struct,
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
            scales=scales,
            position=position,
            **interior.minimiser.compiled,
            **lean,
        )
        self._numbers, self._at_rest = np.zeros(6), np.zeros(plane.size)
        self.displace = self.instance.function("displace", self.struct)
        n, result, function = Buffer(plane.size), Buffer(6 * plane.size), self.instance.function
        self._evaluate = function("evaluate", self.struct, n, n, n, n, int, result, self._numbers)
        self._elevation_change = function("elevation_change", self.struct, n, n, n, n)
        self._stages: dict[tuple[Struct, AndersonMixing], tuple[Any, Callable[..., int]]] = {}
        self._functions = list[Function]()  # which own the structs of the stages

    def evaluate(self, q: Vector, p: Vector, eta: Vector | None, still: Vector) -> Solution | None:
        """Return the solution for masses q and surface potential p, (dofs,) each, with energies.

        ``eta`` is the elevation of a near state [m], ``still`` the column of still water [m]. None where the general
        solver must do it.
        """
        interior, result = self._interior, np.empty((6, self._n))
        recall, counters = interior.recall, interior.counters
        if not recall.recorded or interior.patience is None:
            return None
        for wall in self._following:
            wall.follow()
        eta = self._at_rest if eta is None else eta
        iterations = self._evaluate.call(q, p, eta, still, recall.recorded, result)
        if iterations < 0:
            return None
        recall.recorded += 1
        counters.solves += 1
        counters.iterations += iterations
        if iterations > interior.patience:
            interior.patience = None
        level, kinetic, square, *energies = self._numbers.tolist()
        return Solution(result, level, kinetic, square, energies)

    def elevation_change(self, eta: Vector, still: Vector, dq: Vector) -> Vector:
        """Return by how much the elevation changes with the masses, to first order [m], shape (dofs,)."""
        change = np.empty(self._n)
        self._elevation_change.call(eta, still, dq, change)
        return change

    def solve_stage(
        self, solver: Any, history: Any, advection: Struct, c: Vector, a: float, guess: Any, still: Vector
    ) -> StageResult | None:
        """Return the result of a stage z = c + a f(z); None where the general solver must do it.

        Parameters
        ----------
        solver, history
            The ``StageSolver`` and the ``StageHistory``.
        advection
            The preconditioner for a.
        guess
            An evaluation next to z.
        c, a, still
            See above, with a [s]; and the column of still water [m].
        """
        interior, points = self._interior, history.points
        if not interior.recall.recorded or interior.patience is None:
            return None
        if (advection, points) not in self._stages:
            self._stages[advection, points] = self._stage(solver, points, advection)
        (struct, solve), z = self._stages[advection, points], np.empty_like(c)
        struct.size = np.nan if history.size is None else history.size
        struct.contraction = history.usable_contraction
        known = interior.recall.recorded, interior.patience, points.recorded
        solved = bool(solve(guess.z, guess.flow, c, a, still, *known, z))
        interior.recall.recorded += struct.evaluations
        points.recorded += 1 + solved
        interior.counters.solves += struct.evaluations
        interior.counters.iterations += struct.iterations
        if struct.worn:
            interior.patience = None
        return StageResult(z, solved, struct.size, struct.last_size, struct.measured, struct.evaluations)

    def _stage(self, solver: Any, points: AndersonMixing, advection: Struct) -> tuple[Any, Callable[..., int]]:
        """Return the struct and the function of stages of a weight and a history."""
        struct, size = self.instance.struct, 2 * self._n
        stage = struct(
            "Stage",
            tank=self.struct,
            advection=advection,
            iterates=struct("Mixing", **solver.mixing(1).compiled),
            points=struct("Mixing", **points.compiled),
            found=np.empty((6, self._n)),
            **{name: np.zeros(size) for name in ("residual", "image", "nothing", "missed")},
            **solver.limits,
        )
        n, z = Buffer(self._n), Buffer(size)
        function = self.instance.function("solve_stage", stage, z, z, z, float, n, int, int, int, z)
        self._functions.append(function)
        return stage.c, function.call
