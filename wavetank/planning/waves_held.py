"""Whether a mesh, or any, holds a paddle's waves where no plan is made: by dispersion over a flat bed, as deep."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from wavetank.case import Scene
from wavetank.case.numerics import HIGHEST_VERTICAL_ORDER
from wavetank.planning.defaults import DEFAULT, bed_shape, cell_size_for, frequency_below, vertical_order_for
from wavetank.planning.dispersion import Cells, Mesh, relative_frequency_error
from wavetank.planning.requirements import highest_frequency
from wavetank.values.noun import Problem
from wavetank.waves.airy import wave_number

HELD = 0.01  # what mesh and step may miss: of waves, of their speed
SHORTEST = 0.1  # of the power of a paddle's velocity: its shortest waves


def waves_missed(scene: Scene, cell_size: float) -> Iterator[str]:
    """Yield a sentence for each paddle whose waves the cells, of a size [m], miss, and if the vertical order does.

    Cells are judged where it is shallow and waves are short, the vertical order where it is deep.
    """
    bed = bed_shape(scene)
    missing = partial(_by_cells, scene, cell_size, bed.shallow), partial(_by_order, scene, bed.deep)
    for seen in scene.paddles:
        if (period := seen.paddle_period) is None:
            continue
        waves = {
            "the paddle's waves": 2 * np.pi / period,
            f"the shortest {SHORTEST:.0%} of the paddle's waves": frequency_below(seen, 1 - SHORTEST),
        }
        for missed in missing:
            yield from [told for which, omega in waves.items() if (told := missed(which, omega))][:1]


def too_short(scene: Scene) -> Iterator[Problem]:
    """Yield a problem for each paddle most of whose waves no numerics hold that are chosen for a case."""
    depth, g = bed_shape(scene).deep, scene.tank.gravity
    for seen in scene.paddles:
        if (period := seen.paddle_period) is None:
            continue
        omega = min(2 * np.pi / period, highest_frequency(seen, DEFAULT))
        k = float(wave_number(omega, depth, g))
        if relative_frequency_error(k * depth, HIGHEST_VERTICAL_ORDER) > HELD:
            size = f"T = {2 * np.pi / omega:.3g} s, {2 * np.pi / k:.2g} m long in water {depth:.3g} m deep"
            held = f"no vertical order holds its waves of {size}"
            yield Problem((seen.key, "motion"), None, f"{held}: they are the same in a tank that is less deep")


def _by_cells(scene: Scene, cell_size: float, depth: float, which: str, omega: float) -> str:
    """Return what the cells miss of waves of a frequency [rad/s], a sentence; empty if they hold them."""
    k, order, g = float(wave_number(omega, depth, scene.tank.gravity)), scene.numerics.order, scene.tank.gravity
    mesh = Mesh(cells=Cells(order, cell_size), vertical_order=scene.numerics.vertical_order, depth=depth, gravity=g)
    missed = float(mesh.surface_frequency(mesh.cells.waves(k).mean) / mesh.surface_frequency(k**2)) - 1.0
    if missed <= HELD:
        return ""
    length = 2 * np.pi / k
    nodes = f"cells of {cell_size:.3g} m and order {order} leave {order * length / cell_size:.2g} nodes to {which}"
    size = f"T = {2 * np.pi / omega:.3g} s, {length:.3g} m long in water {depth:.3g} m deep"
    how = "carry none as short" if np.isnan(missed) else f"miss their speed by {missed:.1%}"
    return f"{nodes}, {size}, and {how}: cells of {cell_size_for(k, order):.2g} m hold them"


def _by_order(scene: Scene, depth: float, which: str, omega: float) -> str:
    """Return what the vertical order misses of waves of a frequency [rad/s], a sentence; empty if it holds them."""
    kd, order = float(wave_number(omega, depth, scene.tank.gravity)) * depth, scene.numerics.vertical_order
    missed, enough = relative_frequency_error(kd, order), vertical_order_for(kd)
    if missed <= HELD:
        return ""
    waves = f"{which}, T = {2 * np.pi / omega:.3g} s, in water {depth:.3g} m deep (k d = {kd:.3g})"
    held = f"an order of {enough} holds them" if relative_frequency_error(kd, enough) <= HELD else "no order holds them"
    return f"numerics.vertical_order = {order} misses the speed of {waves} by {missed:.1%}: {held}"
