"""Probes: points in the water at which velocity, acceleration and pressure are recorded."""

from pydantic import Field

from wavetank.case.numerics import Gauge
from wavetank.values.quantities import Coordinate


class Probe(Gauge):
    """A point at which velocity, acceleration and pressure are recorded while there is water."""

    z: Coordinate = Field(description="height above still water, negative below [m]")
