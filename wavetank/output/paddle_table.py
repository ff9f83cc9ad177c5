"""What tables say of a paddle's motion: its columns, in a run's ``paddle.csv`` as in the file for a wave board."""

from wavetank.arrays import Vector

PUSH = {1: ("force [N/m]", "power [W/m]"), 2: ("force [N]", "power [W]")}  # of a tank of one or two dimensions
RATES = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}  # a motion's methods, with their units


def columns(places: Vector | None) -> list[str]:
    """Return the table's columns, of a paddle in segments for each place y along it [m]."""
    at = [""] if places is None else [f"@y={y:.6g}" for y in places]
    return ["t [s]", *(f"{name}{place} [{unit}]" for name, unit in RATES.items() for place in at)]
