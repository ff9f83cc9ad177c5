"""The error of paddles that absorb waves by their elevation: within a step they know it from the steps before only.

The extrapolation changes the reflection by C c^(-3/2) (omega dt)^(7/2), with c the transfer function of the paddle
(``waves/wavemaker.py``) and C from runs of regular waves between a paddle and one that absorbs (``CHANGED``).
"""

import numpy as np

from wavetank.arrays import Vector
from wavetank.case import Scene
from wavetank.waves import airy

CHANGED = 2.5  # measured 1.6 to 3.5: pistons at k d = 0.7, 1.5, 2.5, flaps at 0.7, 1.5, 28 and 40 steps a period
POWER = 3.5  # measured 3.2 to 3.9


def absorption_error(scene: Scene, k: Vector) -> Vector:
    """Return the error of waves of wave numbers k [rad/m] over (omega dt)^(7/2), shape (N,).

    It counts from when waves are back at the farthest gauge. Of several paddles that absorb the largest counts.
    """
    if not scene.absorbing:
        return np.zeros_like(k)
    depth, length = scene.tank.depth, scene.tank.length
    path = 2 * length - max((gauge.x for gauge in scene.all_gauges), default=length)
    back = path / airy.group_velocity(k, depth, scene.tank.gravity)
    makers = [scene.paddles[n].wall.maker for n in scene.absorbing]
    least = np.min([maker.transfer(k, depth) for maker in makers], axis=0)
    return np.asarray(CHANGED * least**-1.5 * np.sqrt(np.maximum(0.0, 1.0 - back / scene.run.duration)))
