"""Everything about steep waves, depths and shapes, into one folder: what docs/extremes.md tells."""

from wavetank.verify import breaking, growth, shape, standing, steepness
from wavetank.verify.report import Report


def write(report: Report) -> None:
    """Write all tables and pictures."""
    for part in (growth, shape, steepness, standing, breaking):
        part.write(report)
