"""The scene as a whole."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from wavetank import motions
from wavetank.scene.initial import Initial, StillWater
from wavetank.scene.noun import Noun, Problem, SceneError
from wavetank.scene.numerics import Gauge, Numerics, Output, Run, named
from wavetank.scene.tanks import Tank
from wavetank.scene.walls import FixedWall, Wall


class NonlinearWater(Noun):
    """Waves of any steepness short of breaking."""

    type: Literal["nonlinear"] = "nonlinear"


class LinearWater(Noun):
    """Waves of small steepness: one factorisation serves the whole run."""

    type: Literal["linear"] = "linear"


Water = Annotated[NonlinearWater | LinearWater, Field(discriminator="type", description="the theory of the waves")]
Physics = Literal["nonlinear", "linear"]


class Scene(Noun):
    """What stands in the laboratory, and what is to be computed of it.

    ``Scene.model_validate(scene.model_dump(mode="json"))`` is the same scene.
    """

    title: str = Field(default="", description="what the case is, in a few words")
    tank: Tank
    wall: Wall = FixedWall()
    water: Water | None = Field(default=None, description="the waves' theory; default: nonlinear, or by accuracy")
    initial: Initial = StillWater()
    gauges: Annotated[tuple[Gauge, ...], BeforeValidator(named)] = Field(default=(), description="the gauges")
    run: Run = Field(description="how long is computed")
    numerics: Numerics = Numerics()
    output: Output = Output()

    @classmethod
    def from_toml(cls, path: Path | str, overrides: Sequence[str] = ()) -> "Scene":
        """Return the scene of a case file, with ``KEY=VALUE`` overrides such as ``"numerics.dt=0.01"``.

        Raises ``InputError`` that lists everything that is wrong, one line each: the file, the line, the key, the value
        received and what is allowed.
        """
        from wavetank.case_file import read_case  # which needs Scene

        return read_case(Path(path), overrides)

    @property
    def physics(self) -> Physics:
        """The type of the water, default resolved."""
        return "nonlinear" if self.water is None else self.water.type

    @property
    def cells(self) -> int:
        """The number of cells along the tank, default resolved."""
        return self.numerics.cells_in(self.tank)

    @property
    def reach(self) -> float:
        """Where the wall's mapping has died out [m], default resolved; ``inf`` for a fixed wall."""
        return self.wall.reach_in(self.tank)

    @property
    def surface_every(self) -> float:
        """Time between snapshots of the surface [s]; by default short against a wave period, 200 to 1000 of them."""
        if self.output.surface_every is not None:
            return self.output.surface_every
        short = 0.5 * (self.tank.depth / self.tank.gravity) ** 0.5
        return float(np.clip(short, self.run.duration / 1000, self.run.duration / 200))

    def motion(self) -> motions.Motion:
        """Return the paddle's motion, checked against the run and the tank.

        Raises ``SceneError`` if its file cannot be had or read, ends before the run, or leaves the mapping's reach.
        """
        motion = self.wall.paddle(self.tank)
        if problems := list(self._motion_problems(motion)):
            raise SceneError(problems)
        return motion

    def _motion_problems(self, motion: motions.Motion) -> Iterator[Problem]:
        if motion.duration < self.run.duration:
            allowed = f"must be at most {motion.duration:g} s, where the recorded motion ends"
            yield Problem(("run", "duration"), self.run.duration, allowed)
        end = min(self.run.duration, motion.duration)
        stroke = np.abs(motion.position(np.linspace(0.0, end, 4001, dtype=np.float64))).max()
        if stroke >= self.reach:
            allowed = f"must be more than {stroke:.4g} m, the paddle's largest distance from rest"
            yield Problem(("wall", "reach"), self.reach, allowed)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        nouns = (self.wall, self.initial, self.numerics)
        problems = [*self._gauge_problems(), *(problem for noun in nouns for problem in noun.problems(self))]
        if problems:
            text = "; ".join(str(problem) for problem in problems)
            raise PydanticCustomError("scene", "{text}", {"text": text, "problems": problems})
        return self

    def _gauge_problems(self) -> Iterator[Problem]:
        count = Counter(gauge.name for gauge in self.gauges)
        for n, gauge in enumerate(self.gauges):
            if not 0 <= gauge.x <= self.tank.length:
                yield Problem(("gauges", n, "x"), gauge.x, f"must be inside the tank, 0 to {self.tank.length:g} m")
            if count[gauge.name] > 1:
                yield Problem(("gauges", n, "name"), gauge.name, "must be a name that no other gauge has")
