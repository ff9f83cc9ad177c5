"""Initial waves that an end of the slice cuts.

A solitary wave and a focused group are solutions in a tank without ends. Where the elevation at a wall is a share s of
the height, the start misses the wave by about F s, relative root mean square: F = 0.4 for solitary waves of 0.1 to 0.6
depths (measured 0.38 to 0.40 for s = 0.001 to 0.1, up to 0.45 for s = 0.5, 20 depths of travel later), F = 1 for
groups, s being that of the envelope (measured 0.6 to 1.3, JONSWAP and Gaussian).
"""

from collections.abc import Iterator

from wavetank.case import Scene
from wavetank.case.initial import FocusedSurface, SolitaryWave
from wavetank.case.tank import SliceTank

LARGEST = 0.01  # of the height, at an end
MISSED = {SolitaryWave: 0.4, FocusedSurface: 1.0}  # relative error of the elevation over that share
CALLED = {SolitaryWave: "solitary wave", FocusedSurface: "group"}


def cut_starts(scene: Scene, accuracy: float | None) -> Iterator[str]:
    """Yield a sentence if an end of a slice cuts the initial wave by more than ``LARGEST`` or the accuracy allows."""
    initial, tank = scene.initial, scene.tank
    if not isinstance(initial, SolitaryWave | FocusedSurface) or not isinstance(tank, SliceTank):
        return
    end = 0 if initial.x < tank.length / 2 else 1
    share = float(initial.at_ends(tank)[end])
    error = MISSED[type(initial)] * share
    if share > LARGEST or error > (accuracy or 1.0):
        wall = f"the wall at x = {[0.0, tank.length][end]:.4g} m"
        wave = f"{wall} cuts the initial {CALLED[type(initial)]}, which has {share:.2g} of its height there"
        yield f"{wave}: the elevation is off by about {error:.2g} of it; initial.x must be farther from the ends"
