"""Types of numbers in a case: physical quantities in SI units, each with its range.

The ranges are wide, from a drop to an ocean. They exclude values such as 1e-300 m that would break arithmetic.
"""

import unicodedata
from typing import Annotated

from pydantic import AfterValidator, Field, Strict


def _one_line(text: str) -> str:
    """Return a text; raise ``ValueError`` for one with line breaks or control characters."""
    if any(unicodedata.category(letter) in ("Cc", "Zl", "Zp") for letter in text):
        raise ValueError("must be one line, without control characters")
    return text


def _zero_or_long_enough(time: float) -> float:
    """Return a time [s]; raise ``ValueError`` for a positive one below ``SHORTEST``."""
    if 0.0 < time < SHORTEST:
        raise ValueError(f"must be 0, which is none, or at least {SHORTEST:g} s")
    return time


def metres(length: float) -> str:
    """Return a length [m] with all its digits, so that a slightly larger one is different."""
    return f"{float(length)!r}".removesuffix(".0")


SHORTEST = 1e-6  # least period or duration [s]

Label = Annotated[str, AfterValidator(_one_line)]  # title or name in tables, pictures and messages

Length = Annotated[float, Field(ge=1e-6, le=1e6)]  # size of tanks, walls, cells [m]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]  # coordinate [m]
Height = Annotated[float, Field(ge=1e-12, le=1e6)]  # height of waves, stroke [m]; very small ones for linear theory
Duration = Annotated[float, Field(ge=SHORTEST, le=1e9)]  # duration, period, step [s]
Ramp = Annotated[float, Field(ge=0, le=1e9), AfterValidator(_zero_or_long_enough)]  # length of a ramp [s]
Frequency = Annotated[float, Field(ge=1e-6, le=1e6)]  # frequency [Hz]
Time = Annotated[float, Field(ge=-1e9, le=1e9)]  # time [s]
Rate = Annotated[float, Field(ge=1e-9, le=1e6)]  # rate [1/s]
Speed = Annotated[float, Field(ge=1e-12, le=1e6)]  # speed [m/s]
Acceleration = Annotated[float, Field(ge=1e-12, le=1e6)]  # acceleration [m/s²]
Density = Annotated[float, Field(ge=1e-3, le=1e5)]  # density [kg/m³]
PerWidth = Annotated[float, Field(ge=0, le=1e9)]  # mass [kg/m], stiffness [N/m²] or damping [N s/m²] per width
Gravity = Annotated[float, Field(ge=1e-3, le=1e3)]  # gravity [m/s²]
Count = Annotated[int, Field(ge=1, le=10**9)]
Fraction = Annotated[float, Field(ge=1e-9, lt=1)]  # fraction of one

Triple = Annotated[tuple[Coordinate, Coordinate, Coordinate], Strict(False)]  # x, y and z [m], a list of three
Pair = Annotated[tuple[Coordinate, Coordinate], Strict(False)]  # x and y, or start and end [m], a list of two
