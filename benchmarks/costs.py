"""Measured cost constants of runs, which ``wavetank/planning/cost.py`` contains as built-in values.

Measure them on a quiet machine and replace the built-in values when the code has become faster.
"""

import numpy as np
from rich.console import Console

from wavetank.planning.cost import BUILT_IN
from wavetank.planning.timing import calibrate, timed


def report(console: Console) -> None:
    """Print each kind's constants, and the seconds of the timed steps by them over those by the ones built in."""
    for key, fitted in calibrate().constants.items():
        steps = timed(key.split()[1])
        rounded = [float(f"{constant:.2g}") for constant in fitted]
        ratios = (steps @ rounded) / (steps @ np.array(BUILT_IN.constants[key]))
        constants = ", ".join(f"{constant:.2g}".replace("e-0", "e-") for constant in rounded)
        console.print(
            f'"{key}": ({constants}),  # {ratios.min():.2f} to {ratios.max():.2f} times',
            soft_wrap=True,
            highlight=False,
        )
