"""The scene: what stands in the laboratory, and what is to be computed of it, as frozen and validated data.

A case file (TOML) says it in these nouns; a ``Scene`` can also be built in Python from the same classes, which then
raise pydantic's own ``ValidationError``. All lengths are in metres, times in seconds. Knows nothing of finite elements.
"""

from wavetank.noun import Noun, Problem, SceneError
from wavetank.scene.beds import Bed, FormulaBed, GriddedBed, PythonBed
from wavetank.scene.directional import (
    DirectionalFocusMotion,
    ObliqueWaveMotion,
    ReflectedFocusMotion,
    SegmentedPistonWall,
)
from wavetank.scene.gauge_lines import GaugeLine
from wavetank.scene.groups import GaussianSpectrum, JonswapSpectrum
from wavetank.scene.initial import Initial, SolitaryWave, StandingWave, StillWater, StreamFunctionWave
from wavetank.scene.initial_formula import FormulaSurface
from wavetank.scene.numerics import Gauge, IntegratorName, Numerics, Output, Run
from wavetank.scene.paddles import AtRestMotion, PaddleMotion, RecordedMotion, SinusoidMotion, WaveGroupMotion
from wavetank.scene.scene import LinearWater, NonlinearWater, Physics, Scene, Water
from wavetank.scene.sponges import AnySponge, EndSponge, FormulaSponge, GroupSponge, Sponge
from wavetank.scene.tanks import AnyTank, BasinTank, RingTank, SliceTank, Tank
from wavetank.scene.walls import FixedWall, PistonWall, Wall

__all__ = [
    "AnySponge",
    "AnyTank",
    "AtRestMotion",
    "BasinTank",
    "Bed",
    "DirectionalFocusMotion",
    "EndSponge",
    "FixedWall",
    "FormulaBed",
    "FormulaSponge",
    "FormulaSurface",
    "Gauge",
    "GaugeLine",
    "GaussianSpectrum",
    "GriddedBed",
    "GroupSponge",
    "Initial",
    "IntegratorName",
    "JonswapSpectrum",
    "LinearWater",
    "NonlinearWater",
    "Noun",
    "Numerics",
    "ObliqueWaveMotion",
    "Output",
    "PaddleMotion",
    "Physics",
    "PistonWall",
    "Problem",
    "PythonBed",
    "RecordedMotion",
    "ReflectedFocusMotion",
    "RingTank",
    "Run",
    "Scene",
    "SceneError",
    "SegmentedPistonWall",
    "SinusoidMotion",
    "SliceTank",
    "SolitaryWave",
    "Sponge",
    "StandingWave",
    "StillWater",
    "StreamFunctionWave",
    "Tank",
    "Wall",
    "Water",
    "WaveGroupMotion",
]
