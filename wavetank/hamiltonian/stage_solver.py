"""Implicit stages by PETSc SNES: accelerated fixed-point iteration first, Newton-Krylov where it does not contract.

A stage z = c + a f(z) is handed over as its residual r(z) = z - c - a f(z). With the system's own preconditioner P
(the identity, or the still-water wave operator for the coupled stage of (23)) the equation solved is P^-1 r(z) = 0,
in unknowns scaled to metres, so that the norm that is judged is close to the error of the surface itself. It is judged
against the waves there are, not against the depth of the water below them: a stage of small waves is as accurate,
relative to these, as one of large waves. Anderson mixing needs one evaluation of f an iteration; each is an elliptic
solve on the tank.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError, WavetankError
from wavetank.hamiltonian.contract import Stage
from wavetank.hamiltonian.start_values import Extrapolation
from wavetank.stateful import Held, give_back, held_by

Preconditioner = Callable[[Stage, Vector], Vector]
Size = Callable[[], float]

ITERATES = 2.0  # dt omega at which any implicit stage still does, of schemes that are stable at any step too
MEMORY = 0.95  # of the waves' size, from one step to the next: a standing wave has moments without elevation
ROUND_OFF = 30 * np.finfo(float).eps  # of the solution, below which no residual is asked for


def identity(stage: Stage, residual: Vector) -> Vector:
    """Return the residual itself: no preconditioning."""
    return residual


@dataclass
class StageCounters:
    """What the implicit stages cost: solves, residual evaluations, and solves that needed Newton-Krylov."""

    solves: int = 0
    evaluations: int = 0
    newton_solves: int = 0

    def __add__(self, other: "StageCounters") -> "StageCounters":
        """Return the sums."""
        return StageCounters(
            self.solves + other.solves,
            self.evaluations + other.evaluations,
            self.newton_solves + other.newton_solves,
        )


class SnesStageSolver:
    """Solves stages with one kind of unknowns (coordinates, momenta, or both).

    Parameters
    ----------
    comm
        Communicator over which the unknowns are distributed.
    scale
        What one unit of the scaled unknowns is, per owned unknown, shape (n,), or (parts, n) of several parts that
        follow one another in the vectors solved for.
    tolerance
        Largest root mean square of the preconditioned, scaled residual, relative to the size of the last solutions.
    size
        Returns, after an evaluation of a residual, how far from rest that point is, as a root mean square in scaled
        units; collective. Default: the distance from zero.
    floor
        What round-off is a part of even where the solution is zero [scaled units].
    precondition
        Approximate inverse of the stage's derivative.
    """

    max_iterations = 25

    def __init__(
        self,
        comm: MPI.Comm,
        scale: Vector,
        *,
        tolerance: float,
        size: Size | None = None,
        floor: float = 1e-6,
        precondition: Preconditioner = identity,
    ):
        self._counters = StageCounters()
        self._error: WavetankError | None = None
        self._comm, self._scale, self._shape = comm, scale.ravel(), scale.shape
        self._tolerance, self._asked = tolerance, size
        self._size = size or (lambda: self._rms(self._x.array_r * self._scale))
        self._floor, self._precondition = floor, precondition
        self._extrapolations: dict[str, Extrapolation] = {}
        self._sizes: dict[str, float] = {}
        self._coupled: dict[int, SnesStageSolver] = {}
        self._x = PETSc.Vec().createMPI((scale.size, None), comm=comm)
        self._root_of_length = float(np.sqrt(self._x.getSize()))
        self._anderson = self._snes("anderson")
        self._anderson.setOptionsPrefix("stage_")
        options = PETSc.Options()
        options["stage_snes_anderson_m"] = 5
        self._anderson.setFromOptions()
        self._newton = self._snes("newtonls")
        self._newton.setUseMF(True)
        krylov = self._newton.getKSP()
        krylov.setType("gmres")
        krylov.setTolerances(rtol=1e-3, max_it=60)
        krylov.getPC().setType("none")

    def coupled(self, copies: int) -> "SnesStageSolver":
        """Return the solver for that many such stages which depend on each other, each preconditioned alone."""
        if copies not in self._coupled:
            self._coupled[copies] = self._copied(copies)
        return self._coupled[copies]

    def _copied(self, copies: int) -> "SnesStageSolver":

        def precondition(stage: Stage, residual: Vector) -> Vector:
            return np.concatenate([self._precondition(stage, part) for part in np.split(residual, copies)])

        return SnesStageSolver(
            self._comm,
            np.concatenate(copies * [np.atleast_2d(self._scale.reshape(self._shape))]),
            tolerance=self._tolerance,
            size=self._asked,
            floor=self._floor,
            precondition=precondition,
        )

    def _snes(self, kind: str) -> PETSc.SNES:
        snes = PETSc.SNES().create(self._comm)
        snes.setType(kind)
        snes.setFunction(self._evaluate, self._x.duplicate())
        return snes

    def _evaluate(self, snes: PETSc.SNES, x: PETSc.Vec, out: PETSc.Vec) -> None:
        self._counters.evaluations += 1
        try:
            residual = self._precondition(self._stage, self._residual(x.array_r * self._scale))
        except WavetankError as error:  # PETSc forgets what was raised below it
            self._error = error
            raise
        out.array = residual / self._scale

    def _rms(self, z: Vector) -> float:
        total = self._comm.allreduce(float(np.sum((z / self._scale) ** 2)))
        return float(np.sqrt(total)) / self._root_of_length

    def solve(self, stage: Stage, residual: Callable[[Vector], Vector], start: Vector) -> Vector:
        """Return z with residual(z) = 0, shape (n,); collective.

        Raises ``ConvergenceError`` naming time, stage and residual.
        """
        earlier = self._earlier(stage.name)
        predicted = earlier.predict(stage.t, stage.dt)
        guess = start if predicted is None else predicted
        self._stage, self._residual = stage, residual
        target = self._target(guess)
        self._counters.solves += 1
        if not self._run(self._anderson, guess, target):
            self._counters.newton_solves += 1
            if not self._run(self._newton, guess, target):
                self._fail(stage, target)
        solution: Vector = self._x.array_r * self._scale
        earlier.record(stage.t, solution)
        self._sizes[stage.name] = max(self._size(), MEMORY * self._sizes[stage.name])
        return solution

    def _earlier(self, stage: str) -> Extrapolation:
        if stage not in self._extrapolations:
            self._extrapolations[stage] = Extrapolation(self._rms, self._shape)
        return self._extrapolations[stage]

    def _target(self, guess: Vector) -> float:
        """Return the norm to which a residual is to fall [scaled units]; collective."""
        if self._stage.name not in self._sizes:
            self._x.array = guess / self._scale
            self._evaluate(self._anderson, self._x, self._x.duplicate())
            self._sizes[self._stage.name] = self._size()
        wanted = self._tolerance * self._sizes[self._stage.name]
        return float(max(wanted, ROUND_OFF * max(self._rms(guess), self._floor)) * self._root_of_length)

    def _run(self, snes: PETSc.SNES, guess: Vector, target: float) -> bool:
        snes.setTolerances(rtol=self._tolerance, atol=target, stol=0.0, max_it=self.max_iterations)
        self._x.array = guess / self._scale
        self._error = None
        try:
            snes.solve(None, self._x)
        except PETSc.Error:
            where = f"t = {self._stage.t:.6g} s: the stage '{self._stage.name}'"
            raise self._error or ConvergenceError(f"{where} could not be evaluated") from None
        return bool(snes.getConvergedReason() > 0)

    def _fail(self, stage: Stage, target: float) -> None:
        unit = self._root_of_length
        raise ConvergenceError(
            f"t = {stage.t:.6g} s: the stage '{stage.name}' did not converge: residual "
            f"{self._newton.getFunctionNorm() / unit:.3g}, wanted {target / unit:.3g}"
        )

    @property
    def counters(self) -> StageCounters:
        """What it has cost so far, and those that it is coupled to."""
        return sum((one.counters for one in self._coupled.values()), self._counters)

    def held(self) -> Held:
        """Return what it remembers of each stage: earlier solutions, their size, and what they cost."""
        return {
            "counters": asdict(self._counters),
            "sizes": dict(self._sizes),
            "earlier": held_by(self._extrapolations),
            "coupled": {str(copies): one.held() for copies, one in self._coupled.items()},
        }

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._counters, self._sizes = StageCounters(**held["counters"]), dict(held["sizes"])
        self._extrapolations.clear()
        give_back({stage: self._earlier(stage) for stage in held["earlier"]}, held["earlier"])
        self._coupled.clear()
        for copies, one in held["coupled"].items():
            self.coupled(int(copies)).take(one)


@dataclass(frozen=True)
class SnesStages:
    """The stage solvers of a system; see ``wavetank.hamiltonian.contract.Stages``."""

    coordinate: SnesStageSolver
    momentum: SnesStageSolver
    pair: SnesStageSolver

    def coupled(self, pairs: int) -> SnesStageSolver:
        """Return the solver for that many pairs at once, made when first asked for."""
        return self.pair.coupled(pairs)

    @classmethod
    def serial(cls, size: int, *, tolerance: float = 1e-14) -> "SnesStages":
        """Return solvers for a system of ``size`` coordinates on this process alone, e.g. an oscillator."""
        one, two = np.ones(size), np.ones((2, size))
        coordinate, momentum, pair = (
            SnesStageSolver(MPI.COMM_SELF, scale, tolerance=tolerance) for scale in (one, one, two)
        )
        return cls(coordinate, momentum, pair)

    @property
    def counters(self) -> StageCounters:
        """What all of them have cost so far."""
        return self.coordinate.counters + self.momentum.counters + self.pair.counters

    def held(self) -> Held:
        """Return what all of them remember."""
        return held_by(vars(self))

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        give_back(vars(self), held)
