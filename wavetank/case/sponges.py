"""The sponge: where waves are absorbed.

Where no strength is given it is that of the least reflection of one wave, found by measurement (docs/absorption.md):

    gamma_0 = 15 c_g / (L lambda)^(1/2)

with the sponge's length L and the wave's group velocity c_g and length lambda. At L = lambda it reflects 0.2 to 2.3 %.
"""

from collections.abc import Callable, Iterator
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from wavetank.case.formulae import FormulaNoun, FormulaText
from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank, RingTank, SliceTank
from wavetank.motion import Array
from wavetank.motion.extent import values
from wavetank.values.formula import Formula
from wavetank.values.noun import Noun, Problem
from wavetank.values.quantities import Duration, Length, Rate
from wavetank.waves.airy import group_velocity, wave_number

ABSORPTION = 15.0  # gamma_0 L / c_g of a sponge of one wave length
UNSEEN = 0.1  # of the power beyond the share: what may look slower than it is
MOST = 2**18  # times; of a longer motion the first part
APART, FINEST = 1e-3, 1e-3  # of a step: two times that tell how fast a motion is; of the first step, the last
GOLDEN = (5**0.5 - 1) / 2  # whose multiples lie everywhere in a step
STEP = 0.1  # of (d / g)^(1/2): at which a paddle's motion is looked at; no paddle makes waves as short


class _Profiled(Noun):
    """A sponge whose damping grows with the distance from its inner edge, up to a strength."""

    type: str
    strength: Rate | None = Field(
        default=None, description="largest damping rate gamma_0 [1/s]; default: of least reflection of the period"
    )
    period: Duration | None = Field(
        default=None,
        description="period of the waves to absorb [s]; default: the paddle's, or that of a wave as long as the sponge",
    )

    def strength_for(self, width: float, tank: AnyTank, *, paddle: float | None = None) -> float:
        """Return gamma_0 [1/s], default resolved.

        Parameters
        ----------
        width
            Of the sponge from its inner edge [m].
        tank
            For its depth.
        paddle
            The period that the paddle moves at [s], if it moves (``paddle_period``).
        """
        if self.strength is not None:
            return self.strength
        period = self.period or paddle
        k = 2 * np.pi / width
        if period is not None:
            k = float(wave_number(2 * np.pi / period, tank.depth, tank.gravity))
        length, speed = 2 * np.pi / k, float(group_velocity(k, tank.depth, tank.gravity))
        return float(ABSORPTION * speed / np.sqrt(width * length))

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a ring, which has no end, and a period without use."""
        yield from _ring_problems(self.type, scene)
        if self.strength is not None and self.period is not None:
            yield Problem(("sponge", "period"), self.period, "must be left out: sponge.strength is given")


class EndSponge(_Profiled):
    """The last ``length`` metres before the far wall."""

    type: Literal["end"] = "end"
    length: Length = Field(description="length of the sponge, along x [m]: one wave length or more")

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield as any sponge, and one longer than the tank."""
        yield from super().problems(scene)
        if self.length >= scene.tank.length:
            allowed = f"must be below the tank's length, {scene.tank.length:g} m"
            yield Problem(("sponge", "length"), self.length, allowed)


class GroupSponge(_Profiled):
    """The cells of the mesh's group ``sponge``; it is as wide as its innermost point is far from its inner edge."""

    type: Literal["group"] = "group"

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield as any sponge, and a tank whose mesh has no groups."""
        yield from super().problems(scene)
        if isinstance(scene.tank, SliceTank):
            yield Problem(("sponge", "type"), self.type, "needs a basin (tank.type), whose mesh has groups of cells")


class FormulaSponge(FormulaNoun):
    """Damping rate gamma(x, y)."""

    type: Literal["formula"] = "formula"
    gamma: FormulaText = Field(description="damping rate gamma(x, y) [1/s], not negative")

    def build(self) -> Formula:
        """Return gamma(x, y) [1/s]."""
        return self.formula(self.gamma)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a ring, which has no end."""
        yield from _ring_problems(self.type, scene)


def _ring_problems(received: str, scene: Surroundings) -> Iterator[Problem]:
    if isinstance(scene.tank, RingTank):
        yield Problem(("sponge", "type"), received, "must be left out: a ring has no end for waves to be absorbed at")


def paddle_period(
    velocity: Callable[[Array], Array], *, duration: float, tank: AnyTank, share: float = 0.5
) -> float | None:
    """Return the period [s] beyond which a share of the power of a paddle's velocity lies; None if it does not move.

    What has less than two of the times that it is looked at in a period looks slower. So it is looked at finer, while
    the acceleration tells that some of what is beyond the share may be so (``UNSEEN``).

    Parameters
    ----------
    velocity
        At times [s], shape (T,), in m/s, shape (T,), or (T, N) for places along the paddle.
    duration
        Of the run [s].
    tank
        For its depth.
    share
        0.5: the period that halves the power.
    """
    step = longest = STEP * float(np.sqrt(tank.depth / tank.gravity))
    while True:
        part = min(duration, MOST * step)
        count = max(256, int(np.ceil(part / step)))
        times = np.arange(count, dtype=np.float64)
        t: Array = part / count * times
        velocities = values(velocity, t).reshape(count, -1)
        lines = (np.abs(np.fft.rfft(velocities, axis=0)) ** 2).sum(axis=1)[1:]
        number, power = np.arange(1.0, lines.size + 1), np.cumsum(lines)
        if not power[-1] > 0.0:
            return None
        soon = APART * part / count
        between = np.minimum(t + part / count * np.modf(GOLDEN * times)[0], part - soon)
        change = (values(velocity, between + soon) - values(velocity, between)).reshape(count, -1) / soon
        rate = (part / (2 * np.pi)) ** 2 * count / 2 * float((change**2).sum())  # as numbers of lines, squared
        unseen = (rate - float(number**2 @ lines)) / lines.size**2
        if unseen < UNSEEN * (1 - share) * power[-1] or step < FINEST * longest:
            return float(part / np.interp(share * power[-1], power, number + 0.5))  # the lines' upper edges
        step /= 2


AnySponge = EndSponge | GroupSponge | FormulaSponge
Sponge = Annotated[AnySponge, Field(discriminator="type", description="where waves are absorbed")]
