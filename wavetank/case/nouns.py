"""All nouns of a scene, by name."""

from wavetank.case.directional import (
    DirectionalComponentsMotion,
    DirectionalFocusMotion,
    DirectionalIrregularMotion,
    DirectionalSurfaceMotion,
    ObliqueWaveMotion,
    ReflectedFocusMotion,
)
from wavetank.case.initial import (
    FileSurface,
    FocusedSurface,
    FormulaSurface,
    Initial,
    IrregularSurface,
    RunState,
    SolitaryWave,
    StandingWave,
    StillWater,
    StreamFunctionWave,
)
from wavetank.case.model import Case, LinearWater, NonlinearWater, Physics, Water
from wavetank.case.numerics import IntegratorName, Numerics, RunNoun
from wavetank.case.output import (
    ComponentsTarget,
    CrestTarget,
    Gauge,
    GaugeLine,
    Output,
    Probe,
    RecordTarget,
    Target,
    WallLoad,
    Window,
)
from wavetank.case.paddle import (
    AtRestMotion,
    BichromaticMotion,
    ComponentsMotion,
    FocusedMotion,
    FormulaMotion,
    IrregularMotion,
    PaddleMotion,
    PythonMotion,
    RecordedMotion,
    RegularMotion,
    SinusoidMotion,
    SolitaryWaveMotion,
    SurfaceMotion,
)
from wavetank.case.tank import (
    AnySponge,
    AnyTank,
    BasinTank,
    BeachBed,
    Bed,
    EndSponge,
    FormulaBed,
    FormulaSponge,
    GriddedBed,
    GroupSponge,
    PythonBed,
    RingTank,
    SliceTank,
    Sponge,
    Tank,
)
from wavetank.case.wall import (
    FixedWall,
    FlapWall,
    PistonWall,
    ProfileWall,
    SegmentedFlapWall,
    SegmentedPistonWall,
    Wall,
)
from wavetank.case.waves import GaussianSpectrum, JonswapSpectrum, PiersonMoskowitzSpectrum, TableSpectrum, TmaSpectrum
from wavetank.values.case_model import CaseError, CaseModel, Problem
