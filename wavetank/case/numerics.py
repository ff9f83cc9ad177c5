"""Numerics and duration of a run."""

from collections.abc import Iterator, Set
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from wavetank.base.case_model import CaseModel, Check, one_of
from wavetank.base.quantities import Count, Duration, Fraction, Length
from wavetank.base.schemes import SCHEMES
from wavetank.case.tank import AnyTank, BasinTank, Context, RingTank, SliceTank


class RunControl(CaseModel):
    """Duration of the run."""

    duration: Duration = Field(description="simulated time [s]")
    on_breaking: Literal["stop", "warn", "dissipate", "ignore"] = Field(
        default="stop",
        description="action when a wave breaks; stop: end the run when a wave overturns; warn: record; "
        "dissipate: an eddy viscosity; ignore: no detection",
    )
    checkpoint_every: Duration | None = Field(
        default=None,
        description="wall time between checkpoints for resuming the run [s]; default: 60, less at first",
    )


HIGHEST_ORDER, HIGHEST_VERTICAL_ORDER = 8, 16

if TYPE_CHECKING:
    IntegratorName = str
else:
    IntegratorName = Literal[tuple(SCHEMES)]


Quantity = Literal["gauges", "crest", "surface", "harmonics", "loads"]
STEP_KEYS = frozenset(
    {"cells", "cell_size", "order", "vertical_order", "integrator"}
)  # keys on which the time step depends
PLANNED_KEYS = STEP_KEYS | {"dt"}  # keys that a plan determines


class Numerics(CaseModel):
    """The numerics.

    With an accuracy, or if no key is set, keys that are not set are planned. Over beds, in basins and for initial
    states by formula, which cannot be planned, the shortest known wave of the case determines cells and vertical order.
    The order is then 4 along a slice over a bed if cells are not set, otherwise 3.
    """

    accuracy: Fraction | None = Field(
        default=None,
        description="planned relative error of the elevation; default: 0.01 if nothing is set and a plan is made",
    )
    cells: Count | None = Field(default=None, description="number of cells along the tank; default: by cell_size")
    cell_size: Length | None = Field(
        default=None,
        description="size of a cell [m], rounded to divide the length; default: from accuracy, or the shortest wave",
    )
    order: int = Field(default=3, ge=1, le=HIGHEST_ORDER, description="horizontal polynomial order p")
    vertical_order: int = Field(default=8, ge=1, le=HIGHEST_VERTICAL_ORDER, description="vertical polynomial order n")
    dt: Duration | None = Field(default=None, description="time step [s]; default: from accuracy and stability")
    integrator: IntegratorName = Field(
        default="simpson-4",
        description="time integrator; third-order is the paper's, reported at the plus trace, its jumps undamped",
    )
    tolerance: float = Field(
        default=1e-6, ge=1e-13, le=1e-4, description="tolerance of implicit stages, relative to the waves"
    )
    stage_solver: Literal["mixing", "petsc"] = Field(
        default="mixing",
        description="solver of implicit stages: Anderson mixing of the program, or of PETSc's SNES",
    )
    edge_penalty: float = Field(
        default=0.25, ge=0, le=10, description="strength of the penalty on kinks under steep crests [-]; 0: none"
    )

    certify: bool = Field(
        default=False, description="whether a companion run on coarser numerics estimates the numerical uncertainty"
    )
    accuracy_of: Quantity | None = Field(
        default=None,
        description="quantity whose numerical uncertainty must not exceed the accuracy; a run above it is repeated "
        "with finer numerics; default: the run is not repeated",
    )

    _one_size = one_of("cells", "cell_size", needed=False)

    @property
    def certified(self) -> bool:
        """Whether the numerical uncertainty of the run is estimated."""
        return self.certify or self.accuracy_of is not None

    @property
    def open(self) -> bool:
        """Whether numerics are planned: an accuracy is set, or no key that a plan determines."""
        return self.accuracy is not None or not self.model_fields_set & PLANNED_KEYS

    def over(self, base: "Numerics", *, named: Set[str]) -> "Numerics":
        """Return ``base`` with the keys that are set here; without a key on which it depends, its time step stays."""
        changes: dict[str, Any] = {key: getattr(self, key) for key in named}
        for one, other in (("cells", "cell_size"), ("cell_size", "cells")):
            if changes.get(one) is not None:
                changes[other] = None
        if named & STEP_KEYS:
            changes = {"dt": None} | changes
        return base.model_copy(update=changes)

    def without(self, key: str) -> "Numerics":
        """Return the same numerics with the default of a key."""
        return Numerics(**{name: getattr(self, name) for name in self.model_fields_set - {key}})

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield the conditions of the number of cells and of the quantity with an accuracy."""
        if self.cells is not None:
            along, fewest = not isinstance(end.tank, BasinTank), end.tank.fewest_cells
            yield "cells", along, "must be left out: numerics.cell_size is a basin's key"
            yield "cells", self.cells >= fewest, f"must be at least {fewest} in a {end.tank.type}"
        if self.certify:
            yield "certify", bool(end.case.all_gauges), "needs a gauge"
        if self.accuracy_of is not None:
            yield "accuracy_of", bool(end.case.all_gauges), "needs a gauge"
            missing = {
                "surface": "needs a slice or a ring" if isinstance(end.tank, BasinTank) else "",
                "harmonics": "" if end.case.regular_period else "needs a paddle motion of one period",
                "loads": "" if end.case.loads else "needs a table [[loads]]",
            }.get(self.accuracy_of, "")
            yield "accuracy_of", not missing, missing

    def cell_size_in(self, tank: AnyTank) -> float:
        """Return the approximate size of a cell [m], default: a part of the depth."""
        return tank.usual_cell * tank.depth if self.cell_size is None else self.cell_size

    def cells_in(self, tank: SliceTank | RingTank) -> int:
        """Return the number of cells along a tank, default resolved."""
        size = self.cell_size_in(tank)
        return max(tank.fewest_cells, round(tank.length / size)) if self.cells is None else self.cells

    @model_serializer(mode="wrap")
    def _without_what_is_planned(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        values: dict[str, Any] = dump(self)
        return {key: values[key] for key in values if not self.open or key in self.model_fields_set}
