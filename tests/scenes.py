"""Cases that several tests need, as Python builds them."""

from wavetank.case import Case

SLICE = {"length": 20.0, "depth": 1.0}


def scene(tank=SLICE, *, duration=20.0, **parts):
    """Return the case of a tank, a duration [s] and other tables."""
    return Case.model_validate({"tank": tank, "run": {"duration": duration}} | parts)


def moving(kind, motion, **more):
    """Return the table of a wall: its type, the type of its motion and the keys of that."""
    return {"type": kind, "motion": {"type": motion, **more}}


def piston(period, amplitude=0.005, **more):
    """Return the table of a piston with a sinusoidal motion."""
    return moving("piston", "sinusoid", paddle_amplitude=amplitude, period=period, **more)
