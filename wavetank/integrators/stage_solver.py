"""Implicit stages by accelerated fixed-point iteration, and by Newton-Krylov where that does not contract.

A stage z = c + a f(z) is handed over as its residual r(z) = z - c - a f(z). With the system's own preconditioner P
(the identity, or the still-water wave operator for the coupled stage of (23)) the equation solved is P^-1 r(z) = 0,
in unknowns scaled to metres, so that the norm that is judged is close to the error of the surface itself. It is judged
against the waves there are, not against the depth of the water below them: a stage of small waves is as accurate,
relative to these, as one of large waves.

Anderson mixing needs one evaluation of f an iteration, each an elliptic solve on the tank. An iteration takes the
error down by a factor that hardly changes from one step to the next: where it is known, the iterate whose error it
predicts to be small enough is the solution, and no evaluation goes to confirm that. So the solution is a point at which
f need not have been evaluated; a scheme has its slope there from the stage itself, f = (z - c) / a.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cached_property
from math import isfinite, sqrt

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from wavetank.arrays import Vector, summed
from wavetank.errors import ConvergenceError, WavetankError
from wavetank.fem.combination import Combination
from wavetank.integrators.hamiltonian import Near, Stage
from wavetank.integrators.start_values import Extrapolation
from wavetank.state import Held, restore_all, states_of

Preconditioner = Callable[[Stage, Vector], Vector]
Size = Callable[[], float]
Led = tuple[Vector, float, float | None]  # where iterates lead; what is left of residuals, and the last iterate's size

ITERATES = 2.0  # dt omega at which any implicit stage still does, of schemes that are stable at any step too
MEMORY = 0.95  # of the waves' size, from one step to the next: a standing wave has moments without elevation
ROUND_OFF = 30 * np.finfo(float).eps  # of the solution, below which no residual is asked for
MIXED = 5  # earlier iterates that take part in an iteration
SHORTEST = 1e-15  # squared, of their steps against the longest
SAFETY = 30.0  # on what an iteration is known to leave: errors of stages that repeat from step to step take energy
WRONG = 10.0  # of what residuals are to have: what may be wrong of points that start values are combined of
CONFIRMED = 16  # solves after which what is known is measured anew


def identity(stage: Stage, residual: Vector) -> Vector:
    """Return the residual itself: no preconditioning."""
    return residual


class Together:
    """What some systems do as one; here nothing, of which None tells, so that it is done one after the other."""

    def begin_stage(self, stage: Stage, near: Near, among: Combination, *, wrong: float) -> Vector | None:
        """Add what is near to points that are known, wrong by so much, and return what to begin with of these."""
        return None

    def attempt(self, stage: Stage, known: Vector, z: Vector, mixing: Combination) -> Led | None:
        """Evaluate a stage z = c + a f(z), of known c, and add z to the mixing by its residual, preconditioned."""
        return None


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


class AndersonStageSolver:
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
    together
        What the system does as one.
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
        together: Together | None = None,
    ):
        self._counters = StageCounters()
        self._comm, self._scale, self._shape = comm, scale.ravel(), scale.shape
        self._tolerance, self._size = tolerance, size
        self._floor, self._precondition, self._together = floor, precondition, together or Together()
        self._extrapolations: dict[str, Extrapolation] = {}
        self._combinations: dict[str, Combination] = {}
        self._sizes: dict[str, float] = {}
        self._left: dict[str, tuple[float, int]] = {}  # of an error by an iteration, and how many solves ago
        self._coupled: dict[int, AndersonStageSolver] = {}
        self._none: Vector = np.zeros(scale.size)  # what residuals are to be
        self._root_of_length = float(np.sqrt(comm.allreduce(scale.size)))

    def coupled(self, copies: int) -> "AndersonStageSolver":
        """Return the solver for that many such stages which depend on each other, each preconditioned alone."""
        if copies not in self._coupled:
            self._coupled[copies] = self._copied(copies)
        return self._coupled[copies]

    def _copied(self, copies: int) -> "AndersonStageSolver":

        def precondition(stage: Stage, residual: Vector) -> Vector:
            return np.concatenate([self._precondition(stage, part) for part in residual.reshape(copies, -1)])

        return AndersonStageSolver(
            self._comm,
            np.concatenate(copies * [np.atleast_2d(self._scale.reshape(self._shape))]),
            tolerance=self._tolerance,
            size=self._size,
            floor=self._floor,
            precondition=precondition,
        )

    def _evaluate(self, z: Vector) -> Vector:
        self._counters.evaluations += 1
        return self._precondition(self._stage, self._residual(z))

    def _norms(self, rows: Vector) -> Vector:
        """Return the root mean squares of vectors in scaled units, (k,) of shape (k, n); collective."""
        scaled = rows / self._scale
        total = summed(self._comm, np.einsum("ki,ki->k", scaled, scaled))
        return np.asarray(np.sqrt(total) / self._root_of_length)

    def _norm(self, z: Vector) -> float:
        scaled = z / self._scale
        return sqrt(summed(self._comm, float(scaled @ scaled))) / self._root_of_length

    def solve(
        self, stage: Stage, residual: Callable[[Vector], Vector], start: Vector, *, near: Near | None = None
    ) -> Vector:
        """Return z with residual(z) = 0, shape (n,); collective.

        Raises ``ConvergenceError`` naming time, stage and residual.
        """
        self._stage, self._residual, self._near = stage, residual, near
        if near is None:
            earlier = self._earlier(stage.name)
            solution = self._solved(earlier.predict(stage.t, stage.dt, start=start))
            earlier.record(stage.t, solution)
            return solution
        among = self._among(stage.name)
        among.begin(stage.weight)
        wrong = WRONG * self._root_of_length * self._wanted(stage.name)
        begun = self._together.begin_stage(stage, near, among, wrong=wrong)
        if begun is None:
            among.add(near.z, near.z - stage.weight * near.slope)
            guess = among.guess(near.known, wrong=wrong)
            begun = np.asarray(guess.z + self._precondition(stage, guess.missed))
        solution = self._solved(begun)
        among.add(solution, near.known)
        return solution

    def _solved(self, guess: Vector) -> Vector:
        """Return the solution of the stage from a start value on; collective."""
        self._counters.solves += 1
        solution = self._iterated(guess)
        if solution is None:
            self._counters.newton_solves += 1
            solution = self._newton(guess)
        name = self._stage.name
        self._sizes[name] = max(self._distance(solution), MEMORY * self._sizes[name])
        return solution

    def _iterated(self, z: Vector) -> Vector | None:
        """Return the solution by Anderson's mixing from z on, or None where it does not converge; collective."""
        name, norm = self._stage.name, np.nan
        self._mixing.forget()
        left, age = self._left.get(name, (np.inf, 0))
        left = left if age < CONFIRMED else np.inf
        for iteration in range(self.max_iterations):
            following, away, length = self._led_to(z)
            before, norm = norm, away / self._root_of_length
            if iteration == 0:
                if name not in self._sizes:
                    self._sizes[name] = self._distance(z)
                target, age = self._target(z, length), age + 1
            else:
                left = norm / before if before else 0.0
            if iteration == 1:
                self._left[name], age = (left, 0), 0
            if not isfinite(norm):
                return None
            z = following
            if norm <= target or SAFETY * left * norm <= target:
                if name in self._left:
                    self._left[name] = self._left[name][0], age
                return z
        return None

    def _led_to(self, z: Vector) -> Led:
        """Return where the iterates so far and z lead; collective."""
        mixing = self._mixing
        if self._near is not None and (led := self._together.attempt(self._stage, self._near.known, z, mixing)):
            self._counters.evaluations += 1
            return led
        residual = self._evaluate(z)
        mixing.add(z - residual, residual)
        guess = mixing.guess(self._none)
        return guess.z, guess.away, None

    @cached_property
    def _mixing(self) -> Combination:
        """Anderson's: the iterates of z - r(z), combined as their residuals r come closest to zero."""
        return Combination(self._comm, self._scale, self._shape, most=1 + MIXED, shortest=SHORTEST)

    def _earlier(self, stage: str) -> Extrapolation:
        if stage not in self._extrapolations:
            self._extrapolations[stage] = Extrapolation(self._norms, self._shape)
        return self._extrapolations[stage]

    def _among(self, stage: str) -> Combination:
        if stage not in self._combinations:
            self._combinations[stage] = Combination(self._comm, self._scale, self._shape)
        return self._combinations[stage]

    def _wanted(self, stage: str) -> float:
        """Return the root mean square that residuals of a stage are to have [scaled units], of none yet 0."""
        return self._tolerance * self._sizes.get(stage, 0.0)

    def _distance(self, z: Vector) -> float:
        """Return how far from rest the point last evaluated is, or z [scaled units]; collective."""
        return self._size() if self._size else self._norm(z)

    def _target(self, guess: Vector, length: float | None = None) -> float:
        """Return the root mean square to which a residual is to fall [scaled units]; collective.

        It is found with the guess's root of squares, which may be known.
        """
        norm = self._norm(guess) if length is None else length / self._root_of_length
        return max(self._wanted(self._stage.name), ROUND_OFF * max(norm, self._floor))

    def _newton(self, guess: Vector) -> Vector:
        """Return the solution by PETSc's Newton-Krylov method; collective."""
        target, error = self._target(guess), list[WavetankError]()
        x = PETSc.Vec().createMPI((guess.size, None), comm=self._comm)

        def evaluate(snes: PETSc.SNES, x: PETSc.Vec, out: PETSc.Vec) -> None:
            try:
                out.array = self._evaluate(x.array_r * self._scale) / self._scale
            except WavetankError as raised:  # PETSc forgets what was raised below it
                error.append(raised)
                raise

        snes = PETSc.SNES().create(self._comm)
        snes.setType("newtonls")
        snes.setFunction(evaluate, x.duplicate())
        snes.setUseMF(True)
        snes.getKSP().setType("gmres")
        snes.getKSP().setTolerances(rtol=1e-3, max_it=60)
        snes.getKSP().getPC().setType("none")
        atol = target * self._root_of_length
        snes.setTolerances(rtol=self._tolerance, atol=atol, stol=0.0, max_it=self.max_iterations)
        x.array = guess / self._scale
        where = f"t = {self._stage.t:.6g} s: the stage '{self._stage.name}'"
        try:
            snes.solve(None, x)
        except PETSc.Error:
            raise next(iter(error), ConvergenceError(f"{where} could not be evaluated")) from None
        if not snes.getConvergedReason() > 0:
            result = snes.getFunctionNorm() / self._root_of_length
            raise ConvergenceError(f"{where} did not converge: residual {result:.3g}, wanted {target:.3g}")
        return np.asarray(x.array_r * self._scale)

    @property
    def counters(self) -> StageCounters:
        """What it has cost so far, and those that it is coupled to."""
        return sum((one.counters for one in self._coupled.values()), self._counters)

    def held(self) -> Held:
        """Return what it remembers of each stage: earlier solutions, their size, and what they cost."""
        return {
            "counters": asdict(self._counters),
            "sizes": dict(self._sizes),
            "left": {stage: list(known) for stage, known in self._left.items()},
            "earlier": states_of(self._extrapolations),
            "among": states_of(self._combinations),
            "coupled": {str(copies): one.held() for copies, one in self._coupled.items()},
        }

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self._counters, self._sizes = StageCounters(**held["counters"]), dict(held["sizes"])
        self._left = {stage: (left, age) for stage, (left, age) in held["left"].items()}
        self._extrapolations.clear()
        restore_all({stage: self._earlier(stage) for stage in held["earlier"]}, held["earlier"])
        self._combinations.clear()
        restore_all({stage: self._among(stage) for stage in held["among"]}, held["among"])
        self._coupled.clear()
        for copies, one in held["coupled"].items():
            self.coupled(int(copies)).take(one)


@dataclass(frozen=True)
class IteratedStages:
    """The stage solvers of a system; see ``wavetank.integrators.hamiltonian.Stages``."""

    coordinate: AndersonStageSolver
    momentum: AndersonStageSolver
    pair: AndersonStageSolver

    def coupled(self, pairs: int) -> AndersonStageSolver:
        """Return the solver for that many pairs at once, made when first asked for."""
        return self.pair.coupled(pairs)

    @classmethod
    def serial(cls, size: int, *, tolerance: float = 1e-14) -> "IteratedStages":
        """Return solvers for a system of ``size`` coordinates on this process alone, e.g. an oscillator."""
        one, two = np.ones(size), np.ones((2, size))
        coordinate, momentum, pair = (
            AndersonStageSolver(MPI.COMM_SELF, scale, tolerance=tolerance) for scale in (one, one, two)
        )
        return cls(coordinate, momentum, pair)

    @property
    def counters(self) -> StageCounters:
        """What all of them have cost so far."""
        return self.coordinate.counters + self.momentum.counters + self.pair.counters

    def held(self) -> Held:
        """Return what all of them remember."""
        return states_of(vars(self))

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        restore_all(vars(self), held)
