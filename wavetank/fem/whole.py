"""Potentials along a slice or ring, all of it on this rank, found as a whole (``whole.c``).

A solve is a dozen calls of compiled functions, and what Python takes between these is as much as what they take. Here
they follow each other in C, on the arrays of the objects that they are of. What is not as usual is left to these: the
first solve, a new preconditioner, water that is none.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.along import Minimum
from wavetank.fem.combination import Combination
from wavetank.fem.kernels import Kernel, defined, source
from wavetank.fem.layers import LayerOperator
from wavetank.fem.mass import BandedMass, MassMatrix
from wavetank.fem.plane import Field, LayeredField, Plane
from wavetank.fem.recall import Recall

WHOLE = """
typedef struct {
    double kinetic, residual;
} Found;
typedef struct {
    int width;
    void *weigh, *multiply, *cells;
    const double *constants;
    const double **fields;
    double *rows, *weights;
} Weighed;
typedef struct Paddle {
    const double *moves;
    void *by_potential, *by_column, *paddle, *paddle_by_column, *hold, *push, *strip;
    double *wall, *by_wall;
    struct Paddle *next;
} Paddle;
typedef struct {
    int dofs, carries, iterations, most, last_iterations, trials;
    double celerity, tolerance, shortest, round_off;
    Paddle *paddles;
    Weighed *mean, *weighed, *moment;
    double *mean_column, *before, *change, *kept;
    void *factor_mass, *solve_mass, *solve_both, *mass, *square, *mass_cells;
    void *take, *cells, *layers, *product, *derivative, *take_single, *single_cells, *single_layers, *correct, *modes;
    void *aim, *start, *keep, *largest, *lines;
    const int *order, *carried;
    const double *damping;
    const double **fields;
    double *column, *phi, *rows, *image, *inputs, *mass_work, *weights, *lengths, *wall;
    double *last, *away, *products, *answer, *gram;
    float *single_rows, *single_state, *work, *ways, *steps;
    Found *found;
} Whole;
typedef struct {
    Whole *whole;
    int most_mixed;
    void *precondition, *inverse, *add, *aim, *combine, *points;
    double *residual, *image, *nothing, *missed, *products;
    const double *scale;
    double away, length;
} Attempt;
typedef struct {
    int paddles, speeds;
    double *eta, *rise, *psi, *numbers, *rates, *velocities;
} Sight;
"""
ROWS = "eta", "rise", "psi", "numbers", "rates", "velocities"
DECLARATIONS = f"""{WHOLE}
int find(Whole *, const double *q, const double *p, const double *still, int recorded, double *flow, double *told);
void ask(Whole *, uintptr_t largest, uintptr_t lines);
void begin_stage(const Attempt *, const double *z, const double *slope, const double *c, double a, int carried,
                 int mixed, double wrong, double *start);
int attempt(Attempt *, const double *z, const double *c, double a, int carried, const double *still, int recorded,
            int mixed, double *found, double *told, double *next);
double push(const Whole *, const double *point, int between, double *of_walls);
void see(Whole *, const double *q, const double *p, const double *point, double kinetic, double gravity,
         const Sight *into, long row);
double energy_near(const Whole *, const double *state, const double *point, double kinetic, double gravity);
int look(Whole *, const double *state, const double *to, const double *at, const double *still, int recorded,
         double gravity, double *found, double *told, const Sight *into, long row);
"""


class Along(Protocol):
    """A wall's part of the energy, that at 1 m/s times X_p'."""

    @property
    def compiled(self) -> dict[str, Any]:
        """What derivatives by potential and column are called with, and its power if it can be, for ``whole.c``.

        And X_p, X_p' and X_p'' [m, m/s, m/s²] as they are.
        """

    def follow(self) -> None:
        """See to it that its power is that of the bed as it is."""


class Inverse(Protocol):
    """The inverse of a stage's residual, nearly.

    Attributes
    ----------
    compiled
        What it is called with.
    carried
        Whether it takes account of the current.
    """

    compiled: dict[str, Any]
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


class Rows(Protocol):
    """Rows of what is seen, as ``tank/seen.py`` has them.

    Attributes
    ----------
    eta, rise, psi, numbers, rates, velocities
        See there.
    """

    eta: Vector
    rise: Vector
    psi: Vector
    numbers: Vector
    rates: Vector
    velocities: Vector


class Leaning(Protocol):
    """What finds columns from masses, and their potential energy, beside a paddle that leans.

    Attributes
    ----------
    mean, column
        The mass matrix with the mean of J over the column, and that column, shape (dofs,) [m].
    moment
        M of the potential energy 1/2 g eta M eta: with the mean of J between eta and still water, by the moment of
        heights, of the water's own column.
    trials, round_off
        How many there are at most, and of the columns what they are found to.
    """

    mean: MassMatrix
    moment: MassMatrix
    column: Vector
    trials: int
    round_off: float


class Glance(NamedTuple):
    """What finds a surface's largest velocity [m/s] and slope [-].

    Attributes
    ----------
    function, lines
        Where the function is, and the struct that it is called with.
    """

    function: int
    lines: Any


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
    surface
        Its largest velocity [m/s] and slope, where ``find`` was asked for them; what that told last else.
    rows
        (A phi)_n less its mean, and the wall's; the negative of M^-1 of the derivative of the energy by the column, the
        wall's included, and that; masses and surface potential that it is of: shape (5, dofs).
    """

    __slots__ = "iterations", "kinetic", "level", "rows", "square", "surface"

    def __init__(self, iterations: int, rows: Vector, told: Sequence[float]):
        self.level, self.kinetic, self.square, *self.surface = told
        self.iterations, self.rows = iterations, rows


class Whole:
    """Finds potentials of column masses and surface potentials.

    Parameters
    ----------
    mass, operator, minimum, recall
        What is called.
    column, phi
        Where column and potential are found.
    walls, leaning
        Of those that move, none to two, and of such as lean.
    carried
        The degrees of freedom at which walls add something.
    inputs
        Numbers by which start values are found: elevation, potential over ``celerity`` [m/s], which are set here, and
        what tells how walls move.

    Attributes
    ----------
    pushes
        Whether the power of all walls is there.
    """

    def __init__(
        self,
        plane: Plane,
        *,
        mass: BandedMass,
        operator: LayerOperator,
        minimum: Minimum,
        recall: Recall,
        column: Field,
        phi: LayeredField,
        walls: Sequence[Along],
        carried: NDArray[np.int32],
        leaning: Leaning | None,
        inputs: Vector,
        celerity: float,
    ):
        self._mass, self._minimum, self._recall, self._walls = mass, minimum, recall, walls
        sizes = {"NUMBERS": phi.rows.shape[1], "FIELDS": operator.density.fields}
        code = defined(sizes) + WHOLE + source("whole.c")
        self._kernel = Kernel("whole", DECLARATIONS, key=code, source=lambda: code, comm=plane.comm)
        fields = self._kernel.pointers(operator.density.values)
        image, flat = np.zeros(phi.rows.shape), np.zeros((1, phi.rows.shape[1]))
        paddles = None  # each knows the one before it
        for wall in walls:
            paddles = self._kernel.shared("Paddle", {**wall.compiled, "next": paddles})
        self.pushes = all("push" in wall.compiled for wall in walls)
        of_walls = [wall.compiled["wall"] for wall in walls] or [flat]
        parts = {
            "dofs": plane.size,
            "celerity": celerity,
            "paddles": paddles,
            "wall": of_walls[0] if len(of_walls) == 1 else np.zeros(phi.rows.shape),
            "carries": len(carried),
            "carried": carried,
            "fields": fields,
            "column": column.rows,
            "phi": phi.rows,
            "image": image,
            "inputs": inputs,
            "damping": None,
            **mass.compiled,
            **mass.compiled_beside,
            **operator.compiled,
            **minimum.compiled,
            **recall.compiled,
            **(self._leaning(leaning) if leaning else {"mean": None, "moment": None}),
        }
        self._struct = self._kernel.shared("Whole", parts)
        self._told = np.zeros(5)
        self._at_told = self._kernel.pointer(self._told)
        self._last: tuple[Vector | None, Any] = None, None  # what ``find`` found last, and where that is
        self._followed: Vector | float | None = None  # the column of still water that walls know
        self._rooms = dict[int, tuple[Rows, Any]]()  # rows by their ids, which they keep, and where they are
        self._trials: dict[tuple[Inverse, Combination], Any] = {}

    def _leaning(self, leaning: Leaning) -> dict[str, Any]:
        """Return what finds columns, and their potential energy, beside a paddle that leans."""
        mean, moment, weighed = (
            self._kernel.shared("Weighed", {**one, "fields": self._kernel.pointers(one["fields"])})
            for one in (leaning.mean.weighing, leaning.moment.weighing, self._mass.weighing)
        )
        room = {"mean_column": leaning.column, **{name: np.empty_like(leaning.column) for name in ("before", "change")}}
        found_to = {"trials": leaning.trials, "round_off": leaning.round_off}
        return {"mean": mean, "moment": moment, "weighed": weighed, **found_to, **room, **self._mass.factoring}

    def find(self, q: Vector, p: Vector, still: Vector | float) -> Solution | None:
        """Return what belongs to masses q and surface potential p, (dofs,) each, or None of what is not as usual.

        ``still`` is the column of still water [m].
        """
        recorded = self._ready()
        if not recorded:
            return None
        at, result = self._kernel.doubles, np.empty((5, p.size))
        surface, into = (at(q), at(p), self._kernel.spread(still, p.size)), at(result)
        self._last = result, into
        return self._solution(self._kernel.call.find(self._struct, *surface, recorded, into, self._at_told), result)

    def ask(self, glance: Glance | None) -> None:
        """Let ``find`` tell the surface's largest velocity and slope, too, by what was asked last; None: no more."""
        self._glance = glance
        function, lines = glance or (0, 0)
        self._kernel.call.ask(self._struct, function, self._kernel.address(lines))

    def damp(self, rate: Vector) -> None:
        """Let what is seen of states tell what a damping of surface potentials takes, of rate [1/s], shape (dofs,)."""
        self._struct.damping = self._kernel.known(rate)

    def attempt(
        self, z: Vector, known: Vector, still: Vector | float, *, weight: float, inverse: Inverse, mixing: Combination
    ) -> tuple[Solution, tuple[Vector, float, float]] | None:
        """Return what belongs to a point z = [q, p] of a stage z = c + a f(z), and where it leads; None as ``find``.

        ``known`` is c, ``weight`` a [s]. It leads to where ``mixing`` takes points by their residuals, of which the
        ``inverse`` is taken; what is left of these there comes then, and last z itself, as roots of squares, scaled.
        """
        recorded, mixed, size = self._ready(), mixing.recorded, z.size // 2
        if not recorded:
            return None
        at, result, following = self._kernel.doubles, np.empty((5, size)), np.empty_like(z)
        trial = self._trial(inverse, mixing, size)
        how = weight, inverse.carried, self._kernel.spread(still, size), recorded, mixed
        into = at(result), self._at_told, at(following)
        solution = self._solution(self._kernel.call.attempt(trial, at(z), at(known), *how, *into), result)
        if solution is None:
            return None
        mixing.recorded += 1
        return solution, (following, trial.away, trial.length)

    def begin_stage(self, near: Near, *, weight: float, wrong: float, inverse: Inverse, among: Combination) -> Vector:
        """Return where to begin a stage z = c + a f(z), from what is known near its solution.

        That is where ``among`` combines points by their c, which are ``wrong`` by so much, with the ``inverse`` of what
        is missed of c; a point that is near takes part from now on.
        """
        self._mass.make_ready()
        at, start, mixed = self._kernel.doubles, np.empty_like(near.z), among.recorded
        trial, given = self._trial(inverse, among, near.z.size // 2), (at(near.z), at(near.slope), at(near.known))
        self._kernel.call.begin_stage(trial, *given, weight, inverse.carried, mixed, wrong, at(start))
        among.recorded += 1
        return start

    def _ready(self) -> int:
        """Make ready for a potential; return how many are known."""
        self._mass.make_ready()
        return self._recall.recorded

    def _solution(self, iterations: int, found: Vector) -> Solution | None:
        """Return what has been found, which is recorded; None of what is not as usual."""
        if iterations < 0:
            return None
        self._recall.recorded += 1
        self._minimum.last = self._struct.last_iterations
        return Solution(iterations, found, self._told.tolist())

    def _trial(self, inverse: Inverse, mixing: Combination, size: int) -> Any:
        """Return what attempts are made with, made once for an inverse and a mixing, which live as long as this."""
        trial = self._trials.get((inverse, mixing))
        if trial is None:
            room = {name: np.zeros(2 * size) for name in ("residual", "image", "nothing", "missed")}
            parts = {"whole": self._struct, **inverse.compiled, **mixing.compiled, **room}
            self._trials[inverse, mixing] = trial = self._kernel.shared("Attempt", parts)
        return trial

    def push(self, point: Vector, still: Vector | float) -> float:
        """Return dH/dt at fixed (Q, psi) of the point last found, whose rows are as a ``Solution`` has them."""
        self._follow(still)
        power: float = self._kernel.call.push(self._struct, self._kernel.pointer(point), 0, self._at_told)
        return power

    def see(
        self,
        state: tuple[Vector, Vector],
        point: Vector,
        still: Vector | float,
        kinetic: float,
        gravity: float,
        into: Rows,
        row: int,
    ) -> None:
        """See masses and surface potential from the point last found, which is near, where all walls ``push``.

        ``point`` and ``still`` are as of ``push`` and ``find``, ``kinetic`` the energy of the point. The power is
        that at the point.
        """
        q, p = state
        self._mass.make_ready()
        self._follow(still)
        at = self._kernel.doubles
        self._kernel.call.see(self._struct, at(q), at(p), at(point), kinetic, gravity, self._room(into), row)

    def energy_near(self, state: Vector, point: Vector, kinetic: float, gravity: float) -> float:
        """Return H of masses and surface potential, [q, p], from the point last found, as ``see`` does."""
        at = self._kernel.doubles
        energy: float = self._kernel.call.energy_near(self._struct, at(state), at(point), kinetic, gravity)
        return energy

    def look(
        self, state: Vector, to: Vector, point: Vector, still: Vector | float, gravity: float, into: Rows, row: int
    ) -> Solution | None:
        """Find the second of two points, and see a state between them from there, as ``see``; None as ``find``.

        State and second point are [q, p], one behind the other, and ``point`` is the first, the one last found, as
        ``push`` takes it: None, too, if that is the second. The power is that of the mean of both.
        """
        recorded = self._ready()
        if not recorded:
            return None
        if still is not self._followed:
            self._follow(still)
        at, result = self._kernel.doubles, np.empty_like(point)
        last, at_last = self._last
        first = at_last if point is last else at(point)
        given = at(state), at(to), first, self._kernel.spread(still, point.shape[1])
        room = at(result), self._at_told, self._room(into), row
        return self._solution(self._kernel.call.look(self._struct, *given, recorded, gravity, *room), result)

    def _follow(self, still: Vector | float) -> None:
        """See to it that walls know the bed as it is."""
        self._followed = still
        for wall in self._walls:
            wall.follow()

    def _room(self, into: Rows) -> Any:
        """Return where rows are, found once."""
        room = self._rooms.get(id(into))
        if room is None:
            sizes = {"paddles": into.rates.shape[1], "speeds": into.velocities.shape[1]}
            rows = {name: getattr(into, name) for name in ROWS}
            self._rooms[id(into)] = room = into, self._kernel.shared("Sight", {**sizes, **rows})
        return room[1]
