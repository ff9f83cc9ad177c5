"""The numerics of a case that does not name them, where no plan can be made: by the shortest wave that is known of it.

It is looked for in the paddle's motion, in the initial surface and in the bed: the wave number (of the motion, the
frequency) below which nearly all of the power lies, or of a measured motion all that stands out of its noise. Where the
bed varies, waves of a frequency are shortest where it is shallow, and the vertical order is needed where it is deep.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from wavetank.arrays import Vector
from wavetank.case import BasinTank, Scene
from wavetank.case.initial import StillWater
from wavetank.case.initial_run import RunState
from wavetank.case.numerics import HIGHEST_VERTICAL_ORDER, Numerics
from wavetank.case.sponges import paddle_period
from wavetank.errors import InputError
from wavetank.plan.dispersion import relative_frequency_error
from wavetank.plan.requirements import highest_frequency, looked_at, tapered
from wavetank.theory import airy

DEFAULT = 1e-2  # relative error of the elevation that a case gets which does not ask for another
POWER = 0.99  # share of it that counts
PER_WAVE = {1: 60.0, 2: 7.0}  # cells of an order in the shortest wave: its frequency is right to 2e-4
OF_HIGHER_ORDER = 3.0  # so it is by order 3
ROUGH = 0.01  # of the depth: what is less of a bed need not be held
VERTICAL = 1e-4  # largest relative error of its frequency by the vertical order
SOLVED, LOOSEST = 1e-3, 1e-5  # of the accuracy, and at most: tolerances of a step's solves
POINTS, LINES = 8192, 5  # at which surface and bed are looked at, along each of so many lines


class BedShape(NamedTuple):
    """The bed: its shortest wave [rad/m], and the smallest depth, but for a few places, and the largest [m]."""

    k: float
    shallow: float
    deep: float


def resolved(scene: Scene) -> Scene:
    """Return the scene with cells and vertical order that its shortest wave requires, where the case names none."""
    named, changes = scene.numerics.model_fields_set, dict[str, float | int]()
    bed = bed_shape(scene)
    omega = max(_of_motion(scene), float(airy.angular_frequency(max(_of_start(scene), 1e-12), bed.deep, _g(scene))))
    k = max(bed.k, float(airy.wave_number(omega, bed.shallow, _g(scene))))
    size = cell_size_for(k, scene.numerics.order)
    if not named & {"cells", "cell_size"} and size < scene.numerics.cell_size_in(scene.tank):
        changes["cell_size"] = float(size)
    if "vertical_order" not in named:
        kd = float(airy.wave_number(omega, bed.deep, _g(scene))) * bed.deep
        changes["vertical_order"] = max(scene.numerics.vertical_order, vertical_order_for(kd))
    if scene.numerics.open:
        changes |= solved_to(DEFAULT, scene)
        changes["order"] = scene.numerics.order  # none is left to be planned
    elif all(getattr(scene.numerics, key) == value for key, value in changes.items()):
        return scene
    return scene.model_copy(update={"numerics": scene.numerics.model_copy(update=changes)})


def by_rule(scene: Scene) -> Scene:
    """Return the scene with the cells and vertical order that it would get if it named none of them."""
    kept = scene.numerics.model_fields_set - {"cells", "cell_size", "vertical_order"}
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


def _of_start(scene: Scene) -> float:
    """Return the shortest wave number of the initial elevation [rad/m]; 0 of still water."""
    initial = scene.initial
    if isinstance(initial, StillWater | RunState):  # the latter has that run's numerics
        return 0.0
    lines = _lines(scene, lambda x, y: initial.surface(scene.tank, x, y)[0])
    return max((_shortest(eta, x, missing=1 - POWER) for x, eta in lines), default=0.0)


def bed_shape(scene: Scene) -> BedShape:
    """Return what waves know of a bed; a flat one is as deep everywhere."""
    depth = scene.depths()
    if not callable(depth):
        return BedShape(0.0, depth, depth)
    lines = _lines(scene, depth)
    depths = np.concatenate([d for _, d in lines] or [np.array([scene.tank.depth])])
    shortest = max((_shortest(d, x, missing=_of_variation(d)) for x, d in lines), default=0.0)
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


def _shortest(values: Vector, x: Vector, *, missing: float) -> float:
    """Return the wave number [rad/m] beyond which a share of the power of values at places x [m] lies."""
    mirrored = np.concatenate([values, values[-2:0:-1]])  # at walls, and without a jump between both ends
    power = np.abs(np.fft.rfft(mirrored)[1:]) ** 2
    if missing >= 1.0 or not power.sum() > 1e-20 * mirrored.size * np.sum(mirrored**2):
        return 0.0
    return float(np.pi / (x[-1] - x[0]) * (1 + np.searchsorted(np.cumsum(power), (1 - missing) * power.sum())))
