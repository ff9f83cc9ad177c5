"""The numerics of a case that does not name them, where no plan can be made: by the shortest wave that is known of it.

It is looked for in the paddle's motion, in the initial surface and in the bed: the wave number (of the motion, the
frequency) below which nearly all of the power lies, or of a measured motion all that stands out of its noise. Where the
bed varies, waves of a frequency are shortest where it is shallow, and the vertical order is needed where it is deep.

A steep initial surface generates bound harmonics that its spectrum lacks. Each of Stokes' harmonics above ``DEFAULT``
of the first makes the shortest wave shorter. On meshes of the first harmonic alone the edge penalty took 4.5 to 22 % of
the energy of modulated wave trains.

Along a slice over a bed the order is 4 and cells are ``COARSER`` than those of order 3, as accurate for linear waves.
Over submerged bars this has an error of about 1 % in 0.85 of the time of order 3, which has 0.9 to 2.3 %
(docs/plan.md). In basins order 3 costs as little.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.case import BasinTank, RingTank, Scene, SliceTank
from wavetank.case.initial import RunState, StillWater
from wavetank.case.numerics import HIGHEST_VERTICAL_ORDER, Numerics
from wavetank.case.tank import paddle_period
from wavetank.errors import InputError
from wavetank.planning.dispersion import relative_frequency_error
from wavetank.planning.requirements import highest_frequency, looked_at, stokes, tapered
from wavetank.waves import airy

DEFAULT = 1e-2  # relative error of the elevation that a case gets which does not ask for another
POWER = 0.99  # share of it that counts
PER_WAVE = {1: 60.0, 2: 7.0}  # cells of an order in the shortest wave: its frequency is right to 2e-4
OF_HIGHER_ORDER = 3.0  # so it is by order 3
BED_ORDER, COARSER = 4, 5 / 3  # along a slice over a bed: the order, and its cells over those of order 3
ROUGH = 0.01  # of the depth: what is less of a bed need not be held
VERTICAL = 1e-4  # largest relative error of its frequency by the vertical order
SOLVED, LOOSEST = 1e-3, 1e-5  # of the accuracy, and at most: tolerances of a step's solves
LEAST = 1e-9  # wave number [rad/m] and frequency [rad/s] that stand for none
POINTS, LINES = 8192, 5  # at which surface and bed are looked at, along each of so many lines


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


def resolved(scene: Scene) -> Scene:
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
        changes.setdefault("order", scene.numerics.order)  # none is left to be planned
    elif all(getattr(scene.numerics, key) == value for key, value in changes.items()):
        return scene
    return scene.model_copy(update={"numerics": scene.numerics.model_copy(update=changes)})


def shortest_wave(scene: Scene) -> ShortestWave:
    """Return the shortest wave of a scene, of wave number ``LEAST`` if there is none."""
    bed, start, still = bed_shape(scene), start_spectrum(scene), ShortestWave(LEAST, "")
    motion, initial = (
        float(airy.wave_number(omega, bed.shallow, _g(scene))) if omega > 0.0 else 0.0
        for omega in (_of_motion(scene), _frequency(start.free, scene))
    )
    sources = {"the bed": bed.k, "the paddle's motion": motion, "the initial surface": max(initial, start.bound)}
    return max(still, *(ShortestWave(k, source) for source, k in sources.items()))


def _frequency(k: float, scene: Scene) -> float:
    """Return the frequency of a wave number [rad/m] where it is deep [rad/s]."""
    return float(airy.angular_frequency(k, bed_shape(scene).deep, _g(scene)))


def by_rule(scene: Scene) -> Scene:
    """Return the scene with the cells and vertical order that it would get if it named its order alone of the three."""
    kept = scene.numerics.model_fields_set - {"cells", "cell_size", "vertical_order"} | {"order"}
    numerics = Numerics(**{key: getattr(scene.numerics, key) for key in kept})
    return resolved(scene.model_copy(update={"numerics": numerics}))


def solved_to(accuracy: float, scene: Scene) -> dict[str, float]:
    """Return the tolerance of a step's solves that an accuracy asks for, by its key; nothing if the scene names one."""
    named = "tolerance" in scene.numerics.model_fields_set
    return {} if named else {"tolerance": min(SOLVED * accuracy, LOOSEST)}


def _g(scene: Scene) -> float:
    return scene.tank.gravity


def cell_size_for(k: float, order: int) -> float:
    """Return the size [m] of cells of an order that hold waves of k [rad/m]."""
    return 2 * np.pi / k / PER_WAVE.get(order, OF_HIGHER_ORDER)


def vertical_order_for(kd: float) -> int:
    """Return the least vertical order that holds waves of k d."""
    orders = range(1, HIGHEST_VERTICAL_ORDER)
    return next((n for n in orders if relative_frequency_error(kd, n) <= VERTICAL), HIGHEST_VERTICAL_ORDER)


def _of_motion(scene: Scene) -> float:
    """Return the frequency below which the paddles move [rad/s]; 0 if they stand still."""
    return max((frequency_below(seen, POWER) for seen in scene.paddles), default=0.0)


def frequency_below(scene: Scene, share: float) -> float:
    """Return that below which a share of the power of a paddle's motion lies [rad/s]; 0 if it stands still.

    It is the paddle of the wall that the scene is seen from.
    """
    motion = scene.motion()
    if not motion.moves:
        return 0.0
    velocity, duration = scene.of_paddle(motion, "velocity"), looked_at(scene, motion)

    def ending(t: Vector) -> Vector:  # gently: a motion that is cut has all frequencies
        return np.asarray((velocity(t).T * tapered(np.asarray(t / duration))).T)

    period = paddle_period(ending, duration=duration, tank=scene.tank, share=share)
    return 0.0 if period is None else min(2 * np.pi / period, highest_frequency(scene, DEFAULT))


def start_spectrum(scene: Scene) -> StartSpectrum:
    """Return the shortest waves of the initial surface; zeros if it is still, or that of another run.

    The power of a wave is |eta|² + |omega psi / g|²; waves beyond ``POWER`` of the power do not count.
    """
    initial, depth = scene.initial, scene.tank.depth
    if isinstance(initial, StillWater | RunState):  # the latter has that run's numerics
        return StartSpectrum(0.0, 0.0)
    found = [StartSpectrum(0.0, 0.0)]
    for x, surface in _lines(scene, lambda x, y: np.array(initial.surface(scene.tank, x, y))):
        k, waves = _spectrum(surface, x, periodic=isinstance(scene.tank, RingTank))
        waves[1] *= airy.angular_frequency(k, depth, _g(scene)) / _g(scene)
        power = np.sum(np.abs(waves) ** 2, axis=0)
        shortest, mean = _shortest(k, power, missing=1 - POWER), float(k @ power / max(power.sum(), 1e-300))
        amplitude = float(np.abs(np.fft.irfft(np.insert(waves, 0, 0.0, axis=-1))).max())
        bound = 0 if scene.physics == "linear" else _bound_harmonics(mean * amplitude, mean * depth)
        found.append(StartSpectrum(shortest, shortest + bound * mean))
    return StartSpectrum(*map(max, zip(*found, strict=True)))


def _bound_harmonics(steepness: float, kd: float) -> int:
    """Return the number of Stokes' bound harmonics above ``DEFAULT`` of the first, itself not counted."""
    return int(np.sum(stokes(steepness, kd).ratios[1:] > DEFAULT)) if steepness > 0.0 else 0


def bed_shape(scene: Scene) -> BedShape:
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
    """Return the share of the power of a bed's variation that is small against the depth, or against all of it."""
    variance = float(np.var(depths))
    return max(1 - POWER, (ROUGH * float(depths.mean())) ** 2 / variance) if variance > 0.0 else 1.0


def _lines(scene: Scene, function: Callable[[Vector, Vector], Vector]) -> list[tuple[Vector, Vector]]:
    """Return places [m] along lines through the tank, and a function at them, of those lines on which it is known."""
    found = []
    for along, x, y in _through(scene):
        with suppress(InputError):  # beyond the walls of a basin nothing need be known
            found.append((along, np.asarray(function(x, y), dtype=np.float64)))
    return [(along, values) for along, values in found if np.isfinite(values).all()]


def _through(scene: Scene) -> list[tuple[Vector, Vector, Vector]]:
    """Return places along lines, and their x and y [m]."""
    if not isinstance(scene.tank, BasinTank):
        x = np.linspace(0.0, scene.tank.length, POINTS, dtype=np.float64)
        return [(x, x, np.zeros_like(x))]
    if scene.tank.layout.box is None:
        return []
    left, low, right, high = scene.tank.layout.box
    x, y = (np.linspace(*ends, POINTS, dtype=np.float64) for ends in ((left, right), (low, high)))
    one, parts = np.ones(POINTS), [(n + 0.5) / LINES for n in range(LINES)]
    along = [(x, x, (low + part * (high - low)) * one) for part in parts]
    return along + [(y, (left + part * (right - left)) * one, y) for part in parts]


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
    """Return the wave number of k [rad/m] beyond which a share of the power lies; 0 without power."""
    if missing >= 1.0 or not power.sum() > 0.0:
        return 0.0
    return float(k[np.searchsorted(np.cumsum(power), (1 - missing) * power.sum())])
