"""All results on integrators in one folder: a CSV and a picture for each table and figure of [G16]."""

from examples.paper import (
    damped_jumps,
    damping,
    dispersion,
    forcing,
    long_orbits,
    overview,
    parasitic,
    phase_space,
    stability,
    symplecticity,
    table_1,
    work_precision,
)
from examples.paper.report import Report

PARTS = (
    overview,
    table_1,
    stability,
    dispersion,
    symplecticity,
    phase_space,
    damping,
    forcing,
    work_precision,
    parasitic,
    damped_jumps,
    long_orbits,
)


def write(report: Report) -> None:
    """Write all tables and pictures."""
    for part in PARTS:
        part.write(report)
