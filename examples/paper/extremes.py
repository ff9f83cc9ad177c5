"""All tables and figures of docs/extremes.md on steep waves, depths and shapes, written into one folder."""

from examples.paper import breaking, growth, shape, standing, steepness
from examples.paper.report import Report


def write(report: Report) -> None:
    """Write all tables and pictures."""
    for part in (growth, shape, steepness, standing, breaking):
        part.write(report)
