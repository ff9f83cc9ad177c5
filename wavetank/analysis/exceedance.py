"""How often waves are higher: of a record, and as Rayleigh and Forristall expect it of a sea.

Sources: M. S. Longuet-Higgins, J. Marine Res. 11, 1952 (Rayleigh); G. Z. Forristall, J. Geophys. Res. 83, 1978
(heights) and J. Phys. Oceanogr. 30, 2000 (crests of second order).
"""

import numpy as np
from numpy.typing import ArrayLike
from xarray import DataArray

from wavetank.errors import InputError
from wavetank.waves.airy import wave_number
from wavetank.waves.wave import Array

CRESTS = {  # of long-crested and of short-crested seas: coefficients of alpha and beta, and the power of Ur in beta
    "long": ((0.3536, 0.2892, 0.1060), (2.0, -2.1597, 0.0, 0.0968)),
    "short": ((0.3536, 0.2568, 0.0800), (2.0, -1.7912, -0.5302, 0.2824)),
}


def exceedance(values: ArrayLike) -> DataArray:
    """Return how often each of N values is exceeded, i / (N + 1) of the i-th largest, over ``value``, descending."""
    ordered = np.sort(np.asarray(values, dtype=float))[::-1]
    share = (1 + np.arange(ordered.size)) / (ordered.size + 1)
    return DataArray(share, {"value": ordered}, ("value",), name="exceedance", attrs={"units": "1"})


def rayleigh_heights(height: ArrayLike, hm0: float) -> Array:
    """Return P(H > height) of a narrow linear spectrum of Hm0 [m]: exp(-2 (H/Hm0)²)."""
    return np.asarray(np.exp(-2 * np.square(np.divide(height, hm0))))


def rayleigh_crests(crest: ArrayLike, hm0: float) -> Array:
    """Return P(crest > c) of a narrow linear spectrum of Hm0 [m]: exp(-8 (c/Hm0)²)."""
    return np.asarray(np.exp(-8 * np.square(np.divide(crest, hm0))))


def forristall_heights(height: ArrayLike, hm0: float) -> Array:
    """Return P(H > height) as measured in storms, whose spectra are not narrow: exp(-(4 H/Hm0)^2.126 / 8.42)."""
    return np.asarray(np.exp(-(np.multiply(height, 4 / hm0) ** 2.126) / 8.42))


def forristall_crests(
    crest: ArrayLike, hm0: float, *, tm01: float, depth: float, gravity: float = 9.81, crested: str = "long"
) -> Array:
    """Return P(crest > c) of simulated seas of second order: exp(-(c / (α Hm0))^β).

    α and β follow from the steepness S1 = 2π Hm0 / (g Tm01²) and Ursell's number Ur = Hm0 / (k1² d³), k1 that of Tm01;
    where both vanish it is Rayleigh's. Lengths are in m, the period in s; seas are ``"long"``- or ``"short"``-crested.
    Raises ``InputError`` for seas so steep that β is not positive.
    """
    alphas, betas = CRESTS[crested]
    S = 2 * np.pi * hm0 / (gravity * tm01**2)
    k = float(wave_number(2 * np.pi / tm01, depth, gravity))
    Ur = 0.0 if np.isinf(depth) else hm0 / (k**2 * depth**3)
    alpha, beta = np.dot(alphas, [1, S, Ur]), np.dot(betas, [1, S, Ur, Ur**2])
    if beta <= 0:
        raise InputError(f"steepness {S:.3g}, Ursell's number {Ur:.3g}: Forristall's crests are for gentler seas.")
    return np.asarray(np.exp(-(np.divide(crest, alpha * hm0) ** beta)))
