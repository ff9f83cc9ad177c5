"""The rule for cells and vertical order of a case that sets neither and cannot be planned.

They follow from its shortest wave: the wave number (for a motion, the frequency) below which nearly all of the power of
the paddle motion, the initial surface and the bed lies. Noise of a measured motion is excluded. Over a bed, waves are
shortest at the smallest depth; the largest depth determines the vertical order.

A steep initial surface generates bound harmonics that are not in its spectrum. The shortest wave is the highest of
Stokes' harmonics above ``DEFAULT`` of the first. On meshes for the first harmonic alone the edge penalty dissipated 4.5
to 22 % of the energy of modulated wave trains.

Along a slice over a bed the order is 4, with cells that are as accurate for linear waves as those of order 3
(``BED_CELLS``). Over submerged bars the error is about 1 % in 0.85 of the time of order 3, with errors of 0.9 to 2.3 %
(docs/plan.md). In basins order 3 costs as little.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.base.case_model import CaseError, Problem
from wavetank.base.errors import InputError
from wavetank.base.mpi import on_first
from wavetank.case import BasinTank, Case, EndWall, RingTank, SliceTank
from wavetank.case.initial import RunState, StillWater
from wavetank.case.numerics import HIGHEST_VERTICAL_ORDER, Numerics
from wavetank.case.paddle import PERIODS
from wavetank.case.tank import paddle_period
from wavetank.integrators.contract import Integrator
from wavetank.planning.dispersion import Mesh, UniformCells, relative_frequency_error
from wavetank.planning.paddle_waves import highest_frequency, tapered
from wavetank.planning.requirements import stokes_harmonics
from wavetank.simulation.build import build_clock
from wavetank.waves import airy

DEFAULT = 1e-2  # relative error of the elevation of a case that names none
POWER = 0.99  # fraction of the power that is resolved
CELLS_PER_WAVE = {1: 60.0, 2: 7.0}  # cells in the shortest wave, by order: the frequency error is 2e-4
CELLS_PER_WAVE_OF_HIGHER_ORDER = 3.0  # cells in the shortest wave of order 3 and higher
BED_ORDER, BED_CELLS = 4, 5 / 3  # order of a slice over a bed, and size of its cells over that of order 3
MIN_BED_VARIATION = 0.01  # least variation of a bed that is resolved, over the depth
VERTICAL_ERROR = 1e-4  # largest relative error of the frequency by the vertical order
TOLERANCE, MAX_TOLERANCE = 1e-3, 1e-5  # tolerance of solves over the accuracy, and the largest tolerance
NO_WAVE = 1e-9  # wave number [rad/m] and frequency [rad/s] of a case without waves
POINTS, LINES = 8192, 5  # points of a line, and lines, along which surface and bed are sampled
MAX_ERROR = 0.01  # largest relative error of the speed of waves and of a paddle's displacement
UNSTABLE_STEP = 1.1  # step over the limit: the largest frequency of a tank is up to 1 % below that of uniform cells


class BedShape(NamedTuple):
    """The bed: its shortest wave [rad/m], the smallest depth except at a few points, and the largest depth [m]."""

    k: float
    shallow: float
    deep: float


class ShortestWave(NamedTuple):
    """The shortest wave of a case.

    Attributes
    ----------
    k, source
        Its wave number [rad/m] and its source; empty if there are no waves.
    kd
        k d of the shortest free wave at the largest depth.
    """

    k: float
    source: str
    kd: float

    def __str__(self) -> str:
        return f"the shortest wave, {2 * np.pi / self.k:.3g} m, is that of {self.source}" if self.source else ""


# ---------------------------------------------------------------- the rule
def resolved(case: Case) -> Case:
    """Return the case with cells and vertical order for its shortest wave, unless the case sets them."""
    numerics, tank, shortest = case.numerics, case.tank, shortest_wave(case)
    named, changes = numerics.model_fields_set, dict[str, float | int](order=numerics.order)
    size, usual = cell_size_for(shortest.k, numerics.order), numerics.cell_size_in(tank)
    if not named & {"cells", "cell_size", "order"} and isinstance(tank, SliceTank) and tank.bed is not None:
        changes |= {"order": BED_ORDER, "cell_size": BED_CELLS * float(min(size, usual))}
    elif not named & {"cells", "cell_size"} and size < usual:
        changes["cell_size"] = float(size)
    if "vertical_order" not in named:
        changes["vertical_order"] = max(numerics.vertical_order, vertical_order_for(shortest.kd))
    if numerics.open:
        changes |= solved_to(DEFAULT, case)
    return case.model_copy(update={"numerics": numerics.model_copy(update=changes)})


def by_rule(case: Case) -> Case:
    """Return the case with the cells and vertical order of the rule for its order."""
    keys = case.numerics.model_fields_set - {"cells", "cell_size", "vertical_order"} | {"order"}
    numerics = Numerics(**{key: getattr(case.numerics, key) for key in keys})
    return resolved(case.model_copy(update={"numerics": numerics}))


def solved_to(accuracy: float, case: Case) -> dict[str, float]:
    """Return the tolerance of the solves for an accuracy, by its key; empty if the case sets one."""
    named = "tolerance" in case.numerics.model_fields_set
    return {} if named else {"tolerance": min(TOLERANCE * accuracy, MAX_TOLERANCE)}


def cell_size_for(k: float, order: int) -> float:
    """Return the size [m] of cells of an order that resolve waves of k [rad/m]."""
    return 2 * np.pi / k / CELLS_PER_WAVE.get(order, CELLS_PER_WAVE_OF_HIGHER_ORDER)


def vertical_order_for(kd: float) -> int:
    """Return the least vertical order that resolves waves of k d."""
    orders = range(1, HIGHEST_VERTICAL_ORDER)
    return next((n for n in orders if relative_frequency_error(kd, n) <= VERTICAL_ERROR), HIGHEST_VERTICAL_ORDER)


# ---------------------------------------------------------------- the shortest wave
def shortest_wave(case: Case) -> ShortestWave:
    """Return the shortest wave of a case; its wave number is ``NO_WAVE`` if there are no waves."""
    bed, g = bed_shape(case), case.tank.gravity
    free, bound = start_spectrum(case)
    started = float(airy.angular_frequency(free, bed.deep, g))
    driven = max((frequency_below(view, POWER) for view in case.paddles), default=0.0)
    motion, initial = (
        float(airy.wave_number(omega, bed.shallow, g)) if omega > 0.0 else 0.0 for omega in (driven, started)
    )
    sources = {"": NO_WAVE, "the bed": bed.k, "the paddle's motion": motion, "the initial surface": max(initial, bound)}
    source = max(sources, key=lambda one: sources[one])
    kd = float(airy.wave_number(max(driven, started, NO_WAVE), bed.deep, g)) * bed.deep
    return ShortestWave(sources[source], source, kd)


def frequency_below(end: EndWall, fraction: float) -> float:
    """Return the frequency [rad/s] below which a fraction of the power of a paddle motion lies; 0 at rest."""
    if not end.motion().moves:
        return 0.0
    duration = end.analysed_duration

    def ending(t: Vector) -> Vector:  # a truncated motion has all frequencies
        return np.asarray((end.rates(t)[1].T * tapered(np.asarray(t / duration))).T)

    period = paddle_period(ending, duration=duration, tank=end.tank, fraction=fraction)
    return 0.0 if period is None else min(2 * np.pi / period, highest_frequency(end, DEFAULT))


def start_spectrum(case: Case) -> tuple[float, float]:
    """Return wave numbers [rad/m] of the shortest free wave and of the shortest bound harmonic of the initial surface.

    They are 0 for still water and for the state of another run. The power of a wave is |eta|² + |omega psi / g|²; waves
    beyond ``POWER`` of the power are neglected.
    """
    initial, tank = case.initial, case.tank
    if isinstance(initial, StillWater | RunState):  # the latter uses the numerics of that run
        return 0.0, 0.0
    free, bound = [0.0], [0.0]
    for x, surface in _profiles(case, lambda x, y: np.array(initial.surface(tank, x, y))):
        k, waves = _spectrum(surface, x, periodic=isinstance(tank, RingTank))
        waves[1] *= airy.angular_frequency(k, tank.depth, tank.gravity) / tank.gravity
        power = np.sum(np.abs(waves) ** 2, axis=0)
        mean = float(k @ power / max(power.sum(), 1e-300))
        amplitude = float(np.abs(np.fft.irfft(np.insert(waves, 0, 0.0, axis=-1))).max())
        free.append(_shortest(k, power, neglected=1 - POWER))
        steep = case.physics != "linear" and mean * amplitude > 0.0
        count = np.sum(stokes_harmonics(mean * amplitude, mean * tank.depth)[0][1:] > DEFAULT) if steep else 0
        bound.append(free[-1] + float(count) * mean)
    return max(free), max(bound)


def bed_shape(case: Case) -> BedShape:
    """Return the shape of the bed; of a flat bed both depths are equal."""
    depth, tank = case.depths(), case.tank
    if not callable(depth):
        return BedShape(0.0, depth, depth)
    shortest, depths = [0.0], list[Vector]()
    for x, d in _profiles(case, depth):
        k, waves = _spectrum(d, x)
        smooth = (MIN_BED_VARIATION * float(d.mean())) ** 2 / max(float(np.var(d)), 1e-300)  # small against the depth
        shortest.append(_shortest(k, np.abs(waves) ** 2, neglected=max(1 - POWER, smooth)))
        depths.append(d)
    every = np.concatenate(depths or [np.array([tank.depth])])
    return BedShape(max(shortest), max(float(np.quantile(every, 0.05)), 1e-3 * tank.depth), float(every.max()))


def _profiles(case: Case, function: Callable[[Vector, Vector], Vector]) -> Iterator[tuple[Vector, Vector]]:
    """Yield positions [m] along lines through the tank, and a function at them, for lines on which it is defined."""
    if (box := case.tank.box) is None:
        return
    x_min, y_min, x_max, y_max = box
    x, y = (np.linspace(*ends, POINTS, dtype=np.float64) for ends in ((x_min, x_max), (y_min, y_max)))
    lines: list[tuple[Vector, Vector, Vector]] = [(x, x, np.zeros(POINTS))]
    if isinstance(case.tank, BasinTank):
        parts = (np.arange(LINES) + 0.5) / LINES
        lines = [(x, x, np.full(POINTS, at)) for at in y_min + parts * (y_max - y_min)]
        lines += [(y, np.full(POINTS, at), y) for at in x_min + parts * (x_max - x_min)]
    for along, x, y in lines:
        with suppress(InputError):  # the bed may be undefined outside the walls of a basin
            values = np.asarray(function(x, y), dtype=np.float64)
            if np.isfinite(values).all():
                yield along, values


def _spectrum(values: Vector, x: Vector, *, periodic: bool = False) -> tuple[Vector, NDArray[np.complex128]]:
    """Return wave numbers [rad/m], shape (K,), and Fourier coefficients of values at equidistant x [m], (..., K).

    Values have shape (..., N); between walls they are mirrored. A variation at round-off level is zero.
    """
    extended = values[..., :-1] if periodic else np.concatenate([values, values[..., -2:0:-1]], axis=-1)
    coefficients = np.fft.rfft(extended)[..., 1:]
    noise = 1e-10 * np.sqrt(extended.shape[-1]) * np.linalg.norm(extended, axis=-1, keepdims=True)
    coefficients[np.linalg.norm(coefficients, axis=-1) <= noise[..., 0]] = 0.0
    k = np.pi * (2 if periodic else 1) / (x[-1] - x[0]) * np.arange(1, coefficients.shape[-1] + 1)
    return np.asarray(k), coefficients


def _shortest(k: Vector, power: Vector, *, neglected: float) -> float:
    """Return the wave number k [rad/m] below which a fraction of the power lies; 0 without power."""
    if neglected >= 1.0 or not power.sum() > 0.0:
        return 0.0
    return float(k[np.searchsorted(np.cumsum(power), (1 - neglected) * power.sum())])


# ---------------------------------------------------------------- refusals
def too_short(case: Case) -> Iterator[Problem]:
    """Yield a problem for each paddle whose mean waves no planned numerics resolve."""
    depth, g = bed_shape(case).deep, case.tank.gravity
    for view in case.paddles:
        if (period := view.period) is None:
            continue
        omega = min(2 * np.pi / period, highest_frequency(view, DEFAULT))
        k = float(airy.wave_number(omega, depth, g))
        if relative_frequency_error(k * depth, HIGHEST_VERTICAL_ORDER) > MAX_ERROR:
            size = f"T = {2 * np.pi / omega:.3g} s, {2 * np.pi / k:.2g} m long in water {depth:.3g} m deep"
            allowed = f"no vertical order resolves its waves of {size}: they are equal in a shallower tank"
            yield view.wall.motion.problem(view.key, PERIODS, allowed)


def still_mesh(case: Case, cell_size: float) -> Mesh:
    """Return cells of a size [m] with a case's numerics, over still water of its tank's depth."""
    chosen, tank = case.numerics, case.tank
    cells = UniformCells(chosen.order, cell_size)
    return Mesh(cells=cells, vertical_order=chosen.vertical_order, depth=tank.depth, gravity=tank.gravity)


def check_stable(case: Case, integrator: Integrator[Any], comm: MPI.Comm) -> None:
    """Raise ``CaseError`` for a step above the largest possible limit, and for unresolvable waves; collective.

    In a slice or ring with a flat bed no mesh is needed; the clock of a run checks other cases.
    """
    dt = case.numerics.dt
    if dt is not None and not isinstance(case.tank, BasinTank) and case.tank.bed is None:
        on_first(comm, lambda: _check_stable(case, integrator, dt))


def _check_stable(case: Case, integrator: Integrator[Any], dt: float) -> None:
    largest = still_mesh(case, case.cell_size).largest_frequency
    if dt * largest <= UNSTABLE_STEP * integrator.stability_limit:
        return
    try:
        build_clock(case, largest, integrator)
    except CaseError as error:
        raise CaseError([*too_short(case), *error.problems]) from None
