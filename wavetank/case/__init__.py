"""The scene: what stands in the laboratory, and what is to be computed of it, as frozen and validated data.

A case file (TOML) says it in these nouns; a ``Case`` can also be built in Python from the same classes, which then
raise pydantic's own ``ValidationError``. All lengths are in metres, times in seconds. Knows nothing of finite elements.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavetank.case.nouns import *  # noqa: F403


def __getattr__(name: str) -> Any:
    """Return a noun; all of them are loaded with the first, and not before."""
    from importlib import import_module

    if not name.startswith("_") and hasattr(nouns := import_module("wavetank.case.nouns"), name):
        return getattr(nouns, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
