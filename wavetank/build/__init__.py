"""From a scene to a system, a scheme and a run: the only package that sees every layer."""

from wavetank.build.runs import (
    Records,
    breaking_watch,
    build_clock,
    build_filters,
    build_observers,
    build_run,
    build_watch,
    initial_state,
    summary,
)
from wavetank.build.waters import Waves, build_waves, told_of_bed

__all__ = [
    "Records",
    "Waves",
    "breaking_watch",
    "build_clock",
    "build_filters",
    "build_observers",
    "build_run",
    "build_watch",
    "build_waves",
    "initial_state",
    "summary",
    "told_of_bed",
]
