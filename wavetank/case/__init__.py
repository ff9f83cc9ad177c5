"""The case: an experiment and its numerics as frozen, validated data.

A case file (TOML) contains these models. A ``Case`` can also be built in Python from the same classes, which then raise
pydantic's ``ValidationError``. Lengths are in metres, times in seconds. The package imports no finite elements.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavetank.case.ends import *  # noqa: F403
    from wavetank.case.initial import *  # noqa: F403
    from wavetank.case.model import *  # noqa: F403
    from wavetank.case.numerics import *  # noqa: F403
    from wavetank.case.output import *  # noqa: F403
    from wavetank.case.paddle import *  # noqa: F403
    from wavetank.case.tank import *  # noqa: F403
    from wavetank.case.wall import *  # noqa: F403

FAMILIES = "model", "ends", "tank", "wall", "paddle", "initial", "output", "numerics"


def __getattr__(name: str) -> Any:
    """Return a model of any family; all are imported with the first."""
    from importlib import import_module

    if not name.startswith("_"):
        for family in FAMILIES:
            if hasattr(module := import_module(f"wavetank.case.{family}"), name):
                return getattr(module, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
