"""Resolution: cells, vertical order and time step for an accuracy, and the predicted error.

**Numerics of a case that does not name them, if no plan can be made**, follow its shortest wave: the wave number (of a
motion, the frequency) below which nearly all of the power of the paddle's motion, the initial surface and the bed lies;
of a measured motion only what exceeds its noise counts. Over a bed waves are shortest at the smallest depth, and the
vertical order is determined at the largest.

A steep initial surface generates bound harmonics that its spectrum lacks. Each of Stokes' harmonics above ``DEFAULT``
of the first makes the shortest wave shorter. On meshes of the first harmonic alone the edge penalty took 4.5 to 22 % of
the energy of modulated wave trains.

Along a slice over a bed the order is 4 and cells are ``COARSER`` than those of order 3, as accurate for linear waves.
Over submerged bars this has an error of about 1 % in 0.85 of the time of order 3, which has 0.9 to 2.3 %
(docs/plan.md). In basins order 3 costs as little.

**The displacement of a paddle.** A scheme evaluates the velocity at its nodes c_i. The paddle's displacement in a step
is then the quadrature

    dt sum_i b_i v(t + c_i dt),     sum_i b_i c_i^m = 1 / (m + 1) for m = 0, 1, ...,

and its differences from the positions add up. With long steps the noise of single rows of a measured motion counts as
motion.

**The error of the elevation** is predicted before a run. A component of frequency omega, of the age of its waves, has
the phase error

    Phi = omega age sum_m w_m ( |e_space(m k)| + |e_time(m omega dt)| ),     w_m = m r_m² / sum_l l r_l²,

e being relative errors of the frequency (``dispersion.py``) and r_m the relative amplitudes of bound harmonics: they
travel with the wave and change its phase in proportion to their energy. To 2 sin(s Phi / 2), s² = sum_m m² r_m² /
sum_m r_m² being the mean square slope of the form, come the bounded errors, of the nodal values and of the start in
the scheme's other modes; the root mean square over the components, weighted with their energies, is the prediction.
Frequencies in space are always too high (the discrete potential has more energy than the exact one), and so are those
of the schemes except Gauss-Legendre's: errors that might cancel are added.

Products of waves cost the discretisation its superconvergence: the part tau_m of the harmonics that the cells do not
represent enters as ``PRODUCTS`` (k a omega age sum_(m > 1) r_m² tau_m²)^(1/2), the age of a group being at most the
time for which it is steep: twice int A² dt over the square of its highest A. Form and constant are empirical, from
standing waves and waves of permanent form; single runs scatter about it, as harmonics may resonate with branches of the
mesh: of 46 waves of permanent form 29 have their error predicted within a factor of three (docs/plan.md). Linear waves
have no such part.

Of a solitary wave that meets a wall the larger of this error and that of its run-up (``requirements.py``) counts.

The elevation is compared with an exact computation of the same waves. Between walls that reflect a paddle's waves age
with the run (``travel.py``). Paddles that absorb add an error of the step (``requirements.py``).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.case import BasinTank, Case, EndWall, RingTank, SliceTank
from wavetank.case.initial import RunState, StillWater
from wavetank.case.numerics import HIGHEST_VERTICAL_ORDER, Numerics
from wavetank.case.tank import paddle_period
from wavetank.errors import InputError
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.mpi import on_first
from wavetank.planning.dispersion import Mesh, UniformCells, relative_frequency_error, step_errors
from wavetank.planning.requirements import (
    ABSORPTION_POWER,
    Requirements,
    analysed_duration,
    highest_frequency,
    stokes,
    tapered,
)
from wavetank.simulation.build import build_clock
from wavetank.values.case_model import CaseError, Problem
from wavetank.waves import airy
from wavetank.waves.airy import wave_number

DEFAULT = 1e-2  # relative error of the elevation that a case gets which does not ask for another
POWER = 0.99  # fraction of the power that counts
PER_WAVE = {1: 60.0, 2: 7.0}  # cells of an order in the shortest wave: its frequency is right to 2e-4
OF_HIGHER_ORDER = 3.0  # so it is by order 3
BED_ORDER, COARSER = 4, 5 / 3  # along a slice over a bed: the order, and its cells over those of order 3
ROUGH = 0.01  # of the depth: smaller variations of a bed need not be resolved
VERTICAL = 1e-4  # largest relative error of its frequency by the vertical order
SOLVED, LOOSEST = 1e-3, 1e-5  # of the accuracy, and at most: tolerances of a step's solves
LEAST = 1e-9  # wave number [rad/m] and frequency [rad/s] that stand for none
POINTS, LINES = 8192, 5  # at which surface and bed are sampled, along each of so many lines


class BedShape(NamedTuple):
    """The bed: its shortest wave [rad/m], and the smallest depth, but for a few places, and the largest [m]."""

    k: float
    shallow: float
    deep: float


class StartSpectrum(NamedTuple):
    """Wave numbers [rad/m] of an initial surface: of its shortest free wave, and of its shortest bound harmonic."""

    free: float
    bound: float


class ShortestWave(NamedTuple):
    """The shortest wave of a scene: its wave number [rad/m] and its source, empty if there is none."""

    k: float
    source: str

    def __str__(self) -> str:
        return f"the shortest wave, {2 * np.pi / self.k:.3g} m, is that of {self.source}" if self.source else ""


def resolved(scene: Case) -> Case:
    """Return the scene with cells and vertical order that its shortest wave requires, where the case names none."""
    named, changes = scene.numerics.model_fields_set, dict[str, float | int]()
    size = cell_size_for(shortest_wave(scene).k, scene.numerics.order)
    usual = scene.numerics.cell_size_in(scene.tank)
    if not named & {"cells", "cell_size", "order"} and isinstance(scene.tank, SliceTank) and scene.tank.bed is not None:
        changes |= {"order": BED_ORDER, "cell_size": COARSER * float(min(size, usual))}
    elif not named & {"cells", "cell_size"} and size < usual:
        changes["cell_size"] = float(size)
    if "vertical_order" not in named:
        deep = bed_shape(scene).deep
        omega = max(_of_motion(scene), _frequency(start_spectrum(scene).free, scene))
        kd = float(airy.wave_number(max(omega, LEAST), deep, _g(scene))) * deep
        changes["vertical_order"] = max(scene.numerics.vertical_order, vertical_order_for(kd))
    if scene.numerics.open:
        changes |= solved_to(DEFAULT, scene)
        changes.setdefault("order", scene.numerics.order)  # the case then names all
    elif all(getattr(scene.numerics, key) == value for key, value in changes.items()):
        return scene
    return scene.model_copy(update={"numerics": scene.numerics.model_copy(update=changes)})


def shortest_wave(scene: Case) -> ShortestWave:
    """Return the shortest wave of a scene, of wave number ``LEAST`` if there is none."""
    bed, start, still = bed_shape(scene), start_spectrum(scene), ShortestWave(LEAST, "")
    motion, initial = (
        float(airy.wave_number(omega, bed.shallow, _g(scene))) if omega > 0.0 else 0.0
        for omega in (_of_motion(scene), _frequency(start.free, scene))
    )
    sources = {"the bed": bed.k, "the paddle's motion": motion, "the initial surface": max(initial, start.bound)}
    return max(still, *(ShortestWave(k, source) for source, k in sources.items()))


def _frequency(k: float, scene: Case) -> float:
    """Return the frequency of a wave number [rad/m] where it is deep [rad/s]."""
    return float(airy.angular_frequency(k, bed_shape(scene).deep, _g(scene)))


def by_rule(scene: Case) -> Case:
    """Return the scene with the cells and vertical order that it would get if it named its order alone of the three."""
    keys = scene.numerics.model_fields_set - {"cells", "cell_size", "vertical_order"} | {"order"}
    numerics = Numerics(**{key: getattr(scene.numerics, key) for key in keys})
    return resolved(scene.model_copy(update={"numerics": numerics}))


def solved_to(accuracy: float, scene: Case) -> dict[str, float]:
    """Return the tolerance of a step's solves that an accuracy asks for, by its key; nothing if the scene names one."""
    named = "tolerance" in scene.numerics.model_fields_set
    return {} if named else {"tolerance": min(SOLVED * accuracy, LOOSEST)}


def _g(scene: Case) -> float:
    return scene.tank.gravity


def cell_size_for(k: float, order: int) -> float:
    """Return the size [m] of cells of an order that hold waves of k [rad/m]."""
    return 2 * np.pi / k / PER_WAVE.get(order, OF_HIGHER_ORDER)


def vertical_order_for(kd: float) -> int:
    """Return the least vertical order that holds waves of k d."""
    orders = range(1, HIGHEST_VERTICAL_ORDER)
    return next((n for n in orders if relative_frequency_error(kd, n) <= VERTICAL), HIGHEST_VERTICAL_ORDER)


def _of_motion(scene: Case) -> float:
    """Return the frequency below which the paddles move [rad/s]; 0 if they stand still."""
    return max((frequency_below(view, POWER) for view in scene.paddles), default=0.0)


def frequency_below(end: EndWall, fraction: float) -> float:
    """Return the frequency below which a fraction of the power of a paddle's motion lies [rad/s]; 0 at rest."""
    motion = end.motion()
    if not motion.moves:
        return 0.0
    duration = analysed_duration(end, motion)

    def ending(t: Vector) -> Vector:  # gently: a motion that is cut has all frequencies
        return np.asarray((end.rates(t)[1].T * tapered(np.asarray(t / duration))).T)

    period = paddle_period(ending, duration=duration, tank=end.tank, fraction=fraction)
    return 0.0 if period is None else min(2 * np.pi / period, highest_frequency(end, DEFAULT))


def start_spectrum(scene: Case) -> StartSpectrum:
    """Return the shortest waves of the initial surface; zeros if it is still, or that of another run.

    The power of a wave is |eta|² + |omega psi / g|²; waves beyond ``POWER`` of the power do not count.
    """
    initial, depth = scene.initial, scene.tank.depth
    if isinstance(initial, StillWater | RunState):  # the latter has that run's numerics
        return StartSpectrum(0.0, 0.0)
    result = [StartSpectrum(0.0, 0.0)]
    for x, surface in _lines(scene, lambda x, y: np.array(initial.surface(scene.tank, x, y))):
        k, waves = _spectrum(surface, x, periodic=isinstance(scene.tank, RingTank))
        waves[1] *= airy.angular_frequency(k, depth, _g(scene)) / _g(scene)
        power = np.sum(np.abs(waves) ** 2, axis=0)
        shortest, mean = _shortest(k, power, missing=1 - POWER), float(k @ power / max(power.sum(), 1e-300))
        amplitude = float(np.abs(np.fft.irfft(np.insert(waves, 0, 0.0, axis=-1))).max())
        steep = scene.physics != "linear" and mean * amplitude > 0.0
        ratios = stokes(mean * amplitude, mean * depth).ratios[1:] if steep else np.zeros(1)
        bound = int(np.sum(ratios > DEFAULT))  # bound harmonics that count
        result.append(StartSpectrum(shortest, shortest + bound * mean))
    return StartSpectrum(*map(max, zip(*result, strict=True)))


def bed_shape(scene: Case) -> BedShape:
    """Return what waves know of a bed; a flat one is as deep everywhere."""
    depth = scene.depths()
    if not callable(depth):
        return BedShape(0.0, depth, depth)
    lines = _lines(scene, depth)
    depths = np.concatenate([d for _, d in lines] or [np.array([scene.tank.depth])])
    spectra = ((d, *_spectrum(d, x)) for x, d in lines)
    shortest = max((_shortest(k, np.abs(c) ** 2, missing=_of_variation(d)) for d, k, c in spectra), default=0.0)
    return BedShape(shortest, max(float(np.quantile(depths, 0.05)), 1e-3 * scene.tank.depth), float(depths.max()))


def _of_variation(depths: Vector) -> float:
    """Return the fraction of the power of a bed's variation that is small against the depth or the variation."""
    variance = float(np.var(depths))
    return max(1 - POWER, (ROUGH * float(depths.mean())) ** 2 / variance) if variance > 0.0 else 1.0


def _lines(scene: Case, function: Callable[[Vector, Vector], Vector]) -> list[tuple[Vector, Vector]]:
    """Return places [m] along lines through the tank, and a function at them, of lines on which it is defined."""
    result = []
    for along, x, y in _through(scene):
        with suppress(InputError):  # it may be undefined beyond the walls of a basin
            result.append((along, np.asarray(function(x, y), dtype=np.float64)))
    return [(along, values) for along, values in result if np.isfinite(values).all()]


def _through(scene: Case) -> list[tuple[Vector, Vector, Vector]]:
    """Return places along lines, and their x and y [m]."""
    if not isinstance(scene.tank, BasinTank):
        x = np.linspace(0.0, scene.tank.length, POINTS, dtype=np.float64)
        return [(x, x, np.zeros_like(x))]
    if scene.tank.layout.box is None:
        return []
    x_min, y_min, x_max, y_max = scene.tank.layout.box
    x, y = (np.linspace(*ends, POINTS, dtype=np.float64) for ends in ((x_min, x_max), (y_min, y_max)))
    one, parts = np.ones(POINTS), [(n + 0.5) / LINES for n in range(LINES)]
    along = [(x, x, (y_min + part * (y_max - y_min)) * one) for part in parts]
    return along + [(y, (x_min + part * (x_max - x_min)) * one, y) for part in parts]


def _spectrum(values: Vector, x: Vector, *, periodic: bool = False) -> tuple[Vector, NDArray[np.complex128]]:
    """Return wave numbers [rad/m], shape (K,), and Fourier coefficients of values at equidistant x [m], (..., K).

    Values have shape (..., N); between walls they are mirrored. A variation at the level of round-off counts as zero.
    """
    extended = values[..., :-1] if periodic else np.concatenate([values, values[..., -2:0:-1]], axis=-1)
    coefficients = np.fft.rfft(extended)[..., 1:]
    noise = 1e-10 * np.sqrt(extended.shape[-1]) * np.linalg.norm(extended, axis=-1, keepdims=True)
    coefficients[np.broadcast_to(np.linalg.norm(coefficients, axis=-1, keepdims=True) <= noise, coefficients.shape)] = 0
    k = np.pi * (2 if periodic else 1) / (x[-1] - x[0]) * np.arange(1, coefficients.shape[-1] + 1)
    return np.asarray(k), coefficients


def _shortest(k: Vector, power: Vector, *, missing: float) -> float:
    """Return the wave number of k [rad/m] beyond which a fraction of the power lies; 0 without power."""
    if missing >= 1.0 or not power.sum() > 0.0:
        return 0.0
    return float(k[np.searchsorted(np.cumsum(power), (1 - missing) * power.sum())])


MISSED = 0.01  # that mesh and step may miss: of the speed of waves, of a paddle's displacement


def too_short(scene: Case) -> Iterator[Problem]:
    """Yield a problem for each paddle whose mean waves no planned numerics resolve."""
    depth, g = bed_shape(scene).deep, scene.tank.gravity
    for view in scene.paddles:
        if (period := view.period) is None:
            continue
        omega = min(2 * np.pi / period, highest_frequency(view, DEFAULT))
        k = float(wave_number(omega, depth, g))
        if relative_frequency_error(k * depth, HIGHEST_VERTICAL_ORDER) > MISSED:
            size = f"T = {2 * np.pi / omega:.3g} s, {2 * np.pi / k:.2g} m long in water {depth:.3g} m deep"
            allowed = f"no vertical order resolves its waves of {size}: they are the same in a tank that is less deep"
            yield Problem((view.key, "motion"), None, allowed)


ROW, BLOCKS = 500, 8  # consecutive steps over which it is summed, and number of such rows of a longer run


def stroke_missed(rates: Callable[[Vector], Vector], *, dt: float, steps: int, nodes: Sequence[float]) -> float:
    """Return what a scheme misses of a paddle's displacement, root mean square, relative to that of the displacement.

    Parameters
    ----------
    rates
        Position and velocity at times [s], shape (T,), in m and m/s, each of shape (T,), or (T, N) for places along
        the paddle; what follows them is ignored.
    dt, steps
        The step [s], and how many there are.
    nodes
        Of the scheme, fractions of the step.
    """
    row = min(steps, ROW)
    starts = np.unique(np.linspace(0, steps - row, min(BLOCKS, -(-steps // row))).astype(int))
    begin = dt * np.add.outer(starts, np.arange(row)).ravel()
    powers = np.arange(len(nodes))
    weights = np.linalg.solve(np.power.outer(np.asarray(nodes, dtype=float), powers).T, 1.0 / (powers + 1))
    quadrature = dt * sum(weight * rates(begin + node * dt)[1] for weight, node in zip(weights, nodes, strict=True))
    before, after = rates(begin)[0], rates(begin + dt)[0]
    off = np.cumsum((quadrature - after + before).reshape(starts.size, row, -1), axis=1)
    stroke = float(np.std(before))
    return float(np.sqrt(np.mean(off**2))) / stroke if stroke > 0.0 else 0.0


SURELY = 1.1  # of the longest step: a tank's largest frequency is below that of endless cells, by a hundredth at most


def still_mesh(scene: Case, cell_size: float) -> Mesh:
    """Return cells of a size [m] with a scene's numerics, over still water of its tank's depth."""
    chosen, tank = scene.numerics, scene.tank
    cells = UniformCells(chosen.order, cell_size)
    return Mesh(cells=cells, vertical_order=chosen.vertical_order, depth=tank.depth, gravity=tank.gravity)


def check_stable(scene: Case, integrator: Integrator[Any], comm: MPI.Comm) -> None:
    """Raise ``CaseError`` for a step that is surely unstable, after waves that no numerics hold; collective.

    Of a slice or ring with a flat bed; what it lets pass is judged by the mesh itself.
    """
    dt = scene.numerics.dt
    if dt is not None and not isinstance(scene.tank, BasinTank) and scene.tank.bed is None:
        on_first(comm, lambda: _check(scene, integrator, dt))


def _check(scene: Case, integrator: Integrator[Any], dt: float) -> None:
    largest = still_mesh(scene, scene.cell_size).largest_frequency
    if dt * largest <= SURELY * integrator.stability_limit:
        return
    try:
        build_clock(scene, largest, integrator)
    except CaseError as error:
        raise CaseError([*too_short(scene), *error.problems]) from None


PRODUCTS = 6.3


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The numerics of a run.

    Attributes
    ----------
    order, vertical_order
        p and n.
    cells
        Number of cells along the tank.
    dt
        [s].
    integrator
        Its name in a case file.
    """

    order: int
    cells: int
    vertical_order: int
    dt: float
    integrator: str


class ErrorPart(NamedTuple):
    """What space or time contributes to the error.

    Attributes
    ----------
    phase, bounded
        Of each component: the phase [rad], and what is bounded, shape (N,).
    run_up
        The relative error of a solitary wave's run-up at a wall.
    """

    phase: Vector
    bounded: Vector
    run_up: float = 0.0


class ErrorModel:
    """Predicts errors for what a scene requires."""

    def __init__(self, required: Requirements):
        self._required = required
        self._ratios = ratios = required.harmonics
        self._m = np.arange(1, ratios.size + 1)
        self._weights = self._m * ratios**2 / np.sum(self._m * ratios**2)
        self._slope = float(np.sqrt(self._m**2 @ ratios**2 / np.sum(ratios**2)))
        waves = required.waves
        self._radians = waves.omega * waves.age
        self._energy = waves.amplitude**2 / np.sum(waves.amplitude**2)
        self._k = np.multiply.outer(waves.k, self._m)
        self._exact = airy.angular_frequency(self._k, required.tank.depth, required.tank.gravity)
        self.mesh, self._products = cache(self._new_mesh), cache(self._product_error)
        self._cells = cache(lambda order, cells: UniformCells(order, required.tank.length / cells))
        self._waves = cache(lambda cells: cells.waves(self._k))

    def _part(self, frequency: Vector, bounded: Vector) -> ErrorPart:
        """Return the part of relative errors per component and harmonic, shape (N, M); ``nan`` is a wave lost."""
        frequency = np.fmin(np.abs(frequency), 1.0)  # what is nan among it, too
        return ErrorPart(self._radians * (frequency @ self._weights), np.sqrt(bounded**2 @ self._ratios**2))

    def _new_mesh(self, order: int, cells: int, vertical_order: int) -> Mesh:
        tank = self._required.tank
        along = self._cells(order, cells)
        return Mesh(cells=along, vertical_order=vertical_order, depth=tank.depth, gravity=tank.gravity)

    def _product_error(self, cells: UniformCells) -> Vector:
        missing = np.sqrt(cells.truncation_error(self._k[:, 1:]) ** 2 @ self._ratios[1:] ** 2)
        steep = self._required.waves.omega * np.minimum(self._required.waves.age, self._required.steep_time)
        return np.asarray(PRODUCTS * np.sqrt(self._required.steepness * steep) * missing)

    def space(self, mesh: Mesh) -> ErrorPart:
        """Return what a mesh of this model contributes."""
        _, mu, profile = self._waves(mesh.cells)
        part = self._part(mesh.surface_frequency(mu) / self._exact - 1.0, profile)
        # Bound harmonics are forced, not free: of them the cells miss what the products have, not a mix of branches.
        run_up = self._required.run_up
        return part._replace(
            bounded=np.hypot(profile[:, 0], self._products(mesh.cells)),
            run_up=0.0 if run_up is None else run_up.error(mesh),
        )

    def time(self, integrator: str, dt: float) -> ErrorPart:
        """Return what a scheme contributes."""
        x = np.multiply.outer(self._required.waves.omega, self._m) * dt
        part = self._part(*step_errors(INTEGRATORS[integrator](), x))
        return part._replace(
            bounded=np.hypot(part.bounded, self._required.absorption_error * x[:, 0] ** ABSORPTION_POWER)
        )

    def total(self, *parts: ErrorPart) -> float:
        """Return the predicted relative error of the elevation."""
        phase = np.minimum(self._slope * sum(part.phase for part in parts), np.pi)
        bounded = np.minimum(sum(part.bounded for part in parts), 1.0)
        travelling = float(np.sqrt(self._energy @ ((2 * np.sin(phase / 2)) ** 2 + bounded**2)))
        return max(travelling, min(sum(part.run_up for part in parts), 1.0))

    def predict(self, settings: Settings) -> float:
        """Return the predicted relative error of the elevation of a run with these settings; inf if it is unstable."""
        mesh = self.mesh(settings.order, settings.cells, settings.vertical_order)
        if settings.dt * mesh.largest_frequency > INTEGRATORS[settings.integrator].stability_limit:
            return np.inf
        return self.total(self.space(mesh), self.time(settings.integrator, settings.dt))
