"""The second harmonic along a tank: bound to the first, with its speed, or free, with a speed of its own.

Bound waves have twice the first's wave number, free ones that of their frequency by the dispersion relation, so that
the sum beats along x; by least squares over gauges they are told apart.
"""

import numpy as np
from xarray import DataArray

from wavetank.analysis.along import Along, told_apart
from wavetank.analysis.records import places
from wavetank.errors import InputError
from wavetank.waves.airy import wave_number


def bound_and_free(
    component: DataArray, frequency: float, *, depth: float, gravity: float = 9.81, returning: bool = False
) -> Along:
    """Return the bound and the free wave of the second harmonic, and the free one that goes back where asked for.

    ``component`` are complex amplitudes [m] of that harmonic over gauge, as ``harmonics`` returns them, of two gauges
    at least, or three; the frequency [Hz] is the first harmonic's, the depth [m] that of the still water at all gauges,
    gravity in m/s². Amplitudes [m] are those at x = 0, complex. Raises ``InputError`` for too few gauges.
    """
    x, omega = places(component), 2 * np.pi * frequency
    k, free = wave_number([omega, 2 * omega], depth, gravity)
    numbers = [2 * k, free, -free] if returning else [2 * k, free]
    if x.size < len(numbers):
        needed = f"at least {len(numbers)} are needed to tell bound waves from free ones"
        raise InputError(f"{x.size} gauges received; {needed}.")
    return told_apart(component.values, x, numbers)


def beat_length(frequency: float, *, depth: float, gravity: float = 9.81) -> float:
    """Return the length [m] over which bound and free waves of the second harmonic come in and out of phase."""
    k, free = wave_number([2 * np.pi * frequency, 4 * np.pi * frequency], depth, gravity)
    return float(2 * np.pi / (free - 2 * k))
