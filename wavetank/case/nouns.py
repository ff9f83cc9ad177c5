"""All nouns of a scene, by name."""

from wavetank.case.beds import BeachBed, Bed, FormulaBed, GriddedBed, PythonBed
from wavetank.case.directional import (
    DirectionalComponentsMotion,
    DirectionalFocusMotion,
    DirectionalIrregularMotion,
    DirectionalSurfaceMotion,
    ObliqueWaveMotion,
    ReflectedFocusMotion,
    SegmentedFlapWall,
    SegmentedPistonWall,
)
from wavetank.case.gauge_lines import GaugeLine
from wavetank.case.initial import Initial, SolitaryWave, StandingWave, StillWater, StreamFunctionWave
from wavetank.case.initial_file import FileSurface
from wavetank.case.initial_formula import FormulaSurface
from wavetank.case.initial_run import RunState
from wavetank.case.initial_sea import FocusedSurface, IrregularSurface
from wavetank.case.loads import WallLoad
from wavetank.case.numerics import Gauge, IntegratorName, Numerics, Output, RunNoun
from wavetank.case.paddles import (
    AtRestMotion,
    FormulaMotion,
    PaddleMotion,
    PythonMotion,
    RecordedMotion,
    SinusoidMotion,
)
from wavetank.case.probes import Probe
from wavetank.case.scene import LinearWater, NonlinearWater, Physics, Scene, Water
from wavetank.case.seas import (
    BichromaticMotion,
    ComponentsMotion,
    FocusedMotion,
    IrregularMotion,
    RegularMotion,
    SolitaryWaveMotion,
    SurfaceMotion,
)
from wavetank.case.spectra import (
    GaussianSpectrum,
    JonswapSpectrum,
    PiersonMoskowitzSpectrum,
    TableSpectrum,
    TmaSpectrum,
)
from wavetank.case.sponges import AnySponge, EndSponge, FormulaSponge, GroupSponge, Sponge
from wavetank.case.tanks import AnyTank, BasinTank, RingTank, SliceTank, Tank
from wavetank.case.targets import ComponentsTarget, CrestTarget, RecordTarget, Target
from wavetank.case.walls import FixedWall, FlapWall, PistonWall, ProfileWall, Wall
from wavetank.case.windows import Window
from wavetank.values.noun import Noun, Problem, SceneError
