"""Everything about steep waves, depths and shapes, into one folder: what docs/extremes.md tells."""

from examples.paper import breaking, growth, shape, standing, steepness
from examples.paper.report import Report


def write(report: Report) -> None:
    """Write all tables and pictures."""
    for part in (growth, shape, steepness, standing, breaking):
        part.write(report)
