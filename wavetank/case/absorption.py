"""Paddles that absorb the waves which come back to them."""

from collections.abc import Iterable, Iterator
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank
from wavetank.motion import Array
from wavetank.values.noun import Noun, Problem
from wavetank.values.quantities import Damping, Duration, Mass, Stiffness
from wavetank.waves.absorption import PassiveFilter, face, radiation
from wavetank.waves.airy import angular_frequency
from wavetank.waves.wavemaker import Wavemaker

BAND = (0.5, 3.0)  # k d of the longest and the shortest waves, by default
POSSIBLE = (0.02, 10.0)  # the same, at most
NARROWEST = 1.05  # the longest period over the shortest


class ActiveAbsorption(Noun):
    """The paddle makes its waves and absorbs others at once, by the elevation at its face."""

    type: Literal["active"] = "active"
    shortest: Duration | None = Field(
        default=None,
        description="shortest period that it is made for [s], half the waves' behind a bar; "
        "default: that of k d = 3, or a paddle's",
    )
    longest: Duration | None = Field(
        default=None, description="longest period that it is made for [s]; default: that of k d = 1/2, or a paddle's"
    )

    def band(self, tank: AnyTank, *, paddles: Iterable[float] = ()) -> tuple[float, float]:
        """Return shortest and longest period [s], defaults resolved; ``paddles`` have these periods [s]."""
        possible = _periods(tank, POSSIBLE)
        periods = [*_periods(tank, BAND), *(float(np.clip(one, *possible)) for one in paddles)]
        shortest, longest = min(periods), max(periods)
        shortest = self.shortest or min(shortest, (self.longest or longest) / NARROWEST)
        return shortest, self.longest or max(longest, shortest * NARROWEST)

    def build(self, tank: AnyTank, maker: Wavemaker, *, paddles: Iterable[float] = ()) -> PassiveFilter:
        """Return the filter by which a paddle of a shape absorbs; as ``band``."""
        shortest, longest = self.band(tank, paddles=paddles)
        return PassiveFilter.fitted(maker, depth=tank.depth, gravity=tank.gravity, shortest=shortest, longest=longest)

    def reflection(self, periods: Array, tank: AnyTank, maker: Wavemaker, *, paddles: Iterable[float] = ()) -> Array:
        """Return how much it sends back of small waves of periods [s], shape (N,); as ``band``."""
        omega = np.asarray(2 * np.pi / periods)
        at_face = face(maker, omega, tank.depth, tank.gravity)
        return np.abs(self.build(tank, maker, paddles=paddles).reflection(at_face, omega))

    def told(self, tank: AnyTank, maker: Wavemaker, *, paddles: Iterable[float] = ()) -> str:
        """Return what it does, in words; as ``band``."""
        shortest, longest = self.band(tank, paddles=paddles)
        periods = np.geomspace(shortest, longest, 50, dtype=np.float64)
        most = self.reflection(periods, tank, maker, paddles=paddles).max()
        band = f"small waves from {shortest:.3g} to {longest:.3g} s"
        return f"it absorbs what comes to it, all but {100 * most:.2g} % of {band} at short steps"

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a band that is none."""
        least, most = _periods(scene.tank, POSSIBLE)
        for name in ("shortest", "longest"):
            period = getattr(self, name)
            if period is not None and not least <= period <= most:
                allowed = f"must be from {least:.4g} to {most:.4g} s, k d = {POSSIBLE[1]:g} to {POSSIBLE[0]:g}"
                yield Problem(("wall", "absorb", name), period, allowed)
        if self.shortest is not None and self.longest is not None and self.longest < NARROWEST * self.shortest:
            allowed = f"must be at least {NARROWEST * self.shortest:.4g} s, {NARROWEST:g} times the shortest"
            yield Problem(("wall", "absorb", "longest"), self.longest, allowed)


class SpringDamper(Noun):
    """The paddle, which is not driven, is a mass on a spring and a damper; of a flap where its motion is told."""

    type: Literal["spring-damper"] = "spring-damper"
    period: Duration | None = Field(
        default=None, description="period that it is tuned to [s]; default: that of the paddle opposite, or of k d = 1"
    )
    mass: Mass = Field(default=0.0, description="mass [kg/m], for a metre's width")
    stiffness: Stiffness | None = Field(
        default=None, description="of the spring [N/m²], for a metre's width; default: none of the period comes back"
    )
    damping: Damping | None = Field(
        default=None, description="of the damper [N s/m²], for a metre's width; default: none of the period comes back"
    )

    def tuned(self, tank: AnyTank, *, paddles: Iterable[float] = ()) -> float:
        """Return the period that it is tuned to [s], default resolved; ``paddles`` have these periods [s]."""
        (usual, _), possible = _periods(tank, (1.0, 1.0)), _periods(tank, POSSIBLE)
        return self.period or float(np.clip(next(iter(paddles), usual), *possible))

    def resolved(self, tank: AnyTank, maker: Wavemaker, *, paddles: Iterable[float] = ()) -> tuple[float, float, float]:
        """Return mass [m²], stiffness [m²/s²] and damping [m²/s] over the density, defaults resolved; as ``tuned``."""
        omega = np.array([2 * np.pi / self.tuned(tank, paddles=paddles)])
        (damping,), (added,) = radiation(maker, omega, tank.depth, tank.gravity)
        mass = self.mass / tank.density
        stiffness = float(omega[0] ** 2 * (mass + added))
        return (
            mass,
            stiffness if self.stiffness is None else self.stiffness / tank.density,
            float(damping) if self.damping is None else self.damping / tank.density,
        )

    def band(self, tank: AnyTank, *, paddles: Iterable[float] = ()) -> tuple[float, float]:
        """Return the period that it is tuned to [s], as shortest and longest."""
        return (self.tuned(tank, paddles=paddles),) * 2

    def reflection(self, periods: Array, tank: AnyTank, maker: Wavemaker, *, paddles: Iterable[float] = ()) -> Array:
        """Return how much it sends back of small waves of periods [s], shape (N,); as ``tuned``."""
        omega = np.asarray(2 * np.pi / periods)
        mass, stiffness, damping = self.resolved(tank, maker, paddles=paddles)
        r, added = radiation(maker, omega, tank.depth, tank.gravity)
        out_of_tune = 1j * (omega * (mass + added) - stiffness / omega)
        return np.abs((damping - r + out_of_tune) / (damping + r + out_of_tune))

    def told(self, tank: AnyTank, maker: Wavemaker, *, paddles: Iterable[float] = ()) -> str:
        """Return what it does, in words; as ``tuned``."""
        tuned, resolved = self.tuned(tank, paddles=paddles), self.resolved(tank, maker, paddles=paddles)
        mass, stiffness, damping = (tank.density * part for part in resolved)
        parts = f"{mass:.4g} kg/m on a spring of {stiffness:.4g} N/m² and a damper of {damping:.4g} N s/m²"
        given = self.stiffness is not None and self.damping is not None
        return f"it absorbs{'' if given else f', tuned to {tuned:.3g} s'}, a mass of {parts}"

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a period that is none of the tank's waves, or that nothing follows from."""
        least, most = _periods(scene.tank, POSSIBLE)
        if self.period is not None and not least <= self.period <= most:
            allowed = f"must be from {least:.4g} to {most:.4g} s, k d = {POSSIBLE[1]:g} to {POSSIBLE[0]:g}"
            yield Problem(("wall", "absorb", "period"), self.period, allowed)
        elif self.period is not None and self.stiffness is not None and self.damping is not None:
            allowed = "must be left out: stiffness and damping are given"
            yield Problem(("wall", "absorb", "period"), self.period, allowed)


Absorption = Annotated[
    ActiveAbsorption | SpringDamper,
    Field(discriminator="type", description="how a paddle absorbs the waves that come back to it"),
]


def _periods(tank: AnyTank, band: tuple[float, float]) -> tuple[float, float]:
    """Return the shortest and the longest period [s] of a band of k d from the least on."""
    low, high = (float(2 * np.pi / angular_frequency(kd / tank.depth, tank.depth, tank.gravity)) for kd in band)
    return high, low
