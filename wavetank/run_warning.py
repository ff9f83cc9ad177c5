"""Warnings of a run: records with a code and figures, and the sentence of each code.

A producer yields ``RunWarning("second-order-limit", key="wall.motion.generation", value=0.1, limit=0.05)``. The
template of the code in ``MESSAGES`` names fields of the record and of its details. A sentence with other names has a
code of its own. The manifest, checkpoints and the Python API contain the records. Code selects and compares records by
their fields, never by their text, which ``str`` returns.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

TEXT = "text"  # the code of a warning that is a sentence only: of a user's observer, or of an older manifest
MESSAGES = {
    TEXT: "{text}",
    "missing-observers": (
        "the run's own observers do not look from t = {t:.6g} s on: {names}; wt.resume(..., observers=...) gives them"
    ),
    "not-resumable": "the run cannot be resumed from here on: {reason}",
    "second-order-limit": (
        "second-order generation is beyond its theory: a second harmonic of {value:.2g} of the wave, where {limit:g} "
        "is the most (H L^2 / d^3 of 26 in shallow water); free waves of higher order are left"
    ),
    "copy-failed": "{key} could not be written ({reason}); {table} has the same",
}


@dataclass(frozen=True)
class RunWarning:
    """A warning of a run.

    Attributes
    ----------
    code
        What is warned of: a key of ``MESSAGES``.
    key
        The key of the case, or the file, that the warning refers to.
    value, limit
        The figure that exceeds its limit, and that limit, in the units of the sentence.
    t
        The time [s].
    x, y
        The place [m]; y in basins only.
    until
        The time up to which the warning holds [s], where the run was resumed with other numerics.
    details
        Further figures and words of the sentence, by their names in the template.
    """

    code: str
    key: str = ""
    value: float | None = None
    limit: float | None = None
    t: float | None = None
    x: float | None = None
    y: float | None = None
    until: float | None = None
    details: Mapping[str, float | str] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return the sentence, without a full stop."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        place = "" if self.x is None else f"x = {self.x:.4g} m" + ("" if self.y is None else f", y = {self.y:.4g} m")
        sentence = MESSAGES.get(self.code, "{text}").format_map({**values, "place": place, **self.details})
        return sentence if self.until is None else f"up to t = {self.until:.6g} s, {sentence}"

    def as_json(self) -> dict[str, Any]:
        """Return the record for a JSON file: the fields that are set, and the sentence as ``message``."""
        values = {name: value for name, value in asdict(self).items() if value not in (None, "", {})}
        return values | {"message": str(self)}


def run_warning(stored: "RunWarning | str | Mapping[str, Any]") -> RunWarning:
    """Return the warning of a sentence, or of an entry of a manifest: a record, or a sentence in older ones.

    A record that this version has no template for, or another one, has its stored sentence as text.
    """
    if isinstance(stored, RunWarning):
        return stored
    if isinstance(stored, str):
        return RunWarning(TEXT, details={"text": stored})
    values = {one.name: stored[one.name] for one in fields(RunWarning) if one.name in stored}
    result = RunWarning(**values)
    try:
        if result.code in MESSAGES and str(result):
            return result
    except (KeyError, ValueError, TypeError):
        pass
    return RunWarning(result.code if result.code not in MESSAGES else TEXT, details={"text": stored["message"]})


def summarise_warnings(warnings: Sequence[RunWarning]) -> str:
    """Return the number of a run's warnings and the first of them, which is the worst."""
    if not warnings:
        return "no warnings"
    return f"a warning: {warnings[0]}" if len(warnings) == 1 else f"{len(warnings)} warnings, the worst: {warnings[0]}"
