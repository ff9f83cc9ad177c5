"""The scene: what stands in the laboratory, and what is to be computed of it, as frozen and validated data.

A case file (TOML) says it in these nouns; a ``Scene`` can also be built in Python from the same classes, which then
raise pydantic's own ``ValidationError``. All lengths are in metres, times in seconds. Knows nothing of finite elements.
"""

from wavetank.scene.initial import Initial, SolitaryWave, StandingWave, StillWater, StreamFunctionWave
from wavetank.scene.noun import Noun, Problem, SceneError
from wavetank.scene.numerics import Gauge, IntegratorName, Numerics, Output, Run
from wavetank.scene.paddles import (
    AtRestMotion,
    GaussianSpectrum,
    JonswapSpectrum,
    PaddleMotion,
    RecordedMotion,
    SinusoidMotion,
    WaveGroupMotion,
)
from wavetank.scene.scene import LinearWater, NonlinearWater, Physics, Scene, Water
from wavetank.scene.tanks import AnyTank, RingTank, SliceTank, Tank
from wavetank.scene.walls import FixedWall, PistonWall, Wall

__all__ = [
    "AnyTank",
    "AtRestMotion",
    "FixedWall",
    "Gauge",
    "GaussianSpectrum",
    "Initial",
    "IntegratorName",
    "JonswapSpectrum",
    "LinearWater",
    "NonlinearWater",
    "Noun",
    "Numerics",
    "Output",
    "PaddleMotion",
    "Physics",
    "PistonWall",
    "Problem",
    "RecordedMotion",
    "RingTank",
    "Run",
    "Scene",
    "SceneError",
    "SinusoidMotion",
    "SliceTank",
    "SolitaryWave",
    "StandingWave",
    "StillWater",
    "StreamFunctionWave",
    "Tank",
    "Wall",
    "Water",
    "WaveGroupMotion",
]
