"""Everything about steep waves, depths and shapes, into one folder: what docs/extremes.md tells."""

from pathlib import Path

from rich.console import Console

from wavetank.verify import breaking, growth, shape, standing, steepness
from wavetank.verify.report import write_parts


def verify_extremes(folder: Path, console: Console) -> None:
    """Write all tables and pictures to ``folder``; raises ``InputError`` if it cannot be written."""
    write_parts((growth, shape, steepness, standing, breaking), folder, console)
