"""Warnings of a run: records with a code and figures, and the sentence of each code.

A producer yields ``RunWarning("second-order-limit", key="wall.motion.generation", value=0.1, limit=0.05)``. The
template of the code in ``MESSAGES`` contains fields of the record and of its details. A sentence with other fields has
another code. The manifest, checkpoints and the Python API contain the records. Code selects and compares records by
their fields, never by their text, which ``str`` returns.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

TEXT = "text"  # code of a warning that is only a sentence: of a user's observer, or of an older manifest
MESSAGES = {
    TEXT: "{text}",
    "missing-observers": (
        "observers of the run are missing from t = {t:.6g} s on: {names}; wt.resume(..., observers=...) adds them"
    ),
    "short-waves": (
        "t = {t:.6g} s: short waves that alternate from step to step have grown to {value:.2g} % of the highest "
        "elevation, most at {place}: from here on the run is not accurate; half the step or finer cells may help"
    ),
    "unstable-step": (
        "t = {t:.6g} s: short waves that alternate from step to step have grown to {value:.2g} % of the highest "
        "elevation, most at {place}: from here on the run is not accurate; under the crests dt omega_max = "
        "{product:.3g} exceeds the limit {stable:.4g} of the scheme: numerics.dt must be at most {longest:.2g} s"
    ),
    "energy-gained": "{part} has given the waves {value:.2g} of the energy by t = {t:.4g} s: {meaning}",
    "energy-lost": "{part} has taken {value:.2g} of the energy: {cure}",
    "energy-balance": "the energy balance is off by {value:.2g} of the energy: {reason}",
    "paddle-limit": (
        "absorption moved the paddle of {key} to a {name} of {value:.4g} {unit}; {key}.limits.{name} allows "
        "{limit:.4g} {unit}"
    ),
    "dry-probes": "probes without water at any time, their columns are empty: {points}",
    "not-resumable": "the run cannot be resumed from here on: {reason}",
    "second-order-limit": (
        "second-order generation is outside its theory: the second harmonic is {value:.2g} of the wave, the limit is "
        "{limit:g} (H L^2 / d^3 = 26 in shallow water); free waves of higher order remain"
    ),
    "cut-start": (
        "the wall at x = {x:.4g} m cuts the initial {wave}, whose elevation there is {value:.2g} of its height: the "
        "error of the elevation is about {error:.2g} of the height; initial.x must be farther from the ends"
    ),
    "wave-too-high": (
        "by linear theory the paddle of {key} generates a wave {value:.3g} m high and {length:.3g} m long at "
        "x = {x:.3g} m, t = {t:.3g} s; the highest wave of this length is {limit:.3g} m high, and nearly all measured "
        'waves above {breaks:g} of that broke; run.on_breaking = "dissipate" computes beyond breaking'
    ),
    "waves-too-long": (
        "the recorded motion of {key} has a mean period of {period:.3g} s, of waves {length:.3g} m long; in this tank "
        "they should be shorter than {limit:.3g} m{note}"
    ),
    "sponge-reflects": (
        "the sponge reflects about {value:.0%} of the paddle's waves (T = {period:.3g} s, {length:.3g} m long), and "
        'steep waves may break in front of it; a sponge of type "end" or "group" that is at least one wave long, with '
        "the default strength, reflects about 2%"
    ),
    "inaccurate": ("the predicted error of the elevation is {value:.0%}; `wavetank plan` proposes other numerics"),
    "inaccurate-deep-waves": (
        "the predicted error of the elevation is {value:.0%}; waves that are so short compared with the depth "
        "(k d = {kd:.3g}) are equal in a shallower tank (tank.depth)"
    ),
    "cells-too-large": (
        "cells of {value:.3g} m and order {order:.0f} have {nodes:.2g} nodes in waves of {wall}, T = {period:.3g} s, "
        "{length:.3g} m long in water {depth:.3g} m deep, and miss their speed by {missed:.1%}; cells of {limit:.2g} m "
        "resolve them"
    ),
    "vertical-order-too-low": (
        "numerics.vertical_order = {value:.0f} misses the speed of waves of {wall}, T = {period:.3g} s, in water "
        "{depth:.3g} m deep (k d = {kd:.3g}) by {missed:.1%}: an order of {limit:.0f} resolves them"
    ),
    "waves-too-deep": (
        "numerics.vertical_order = {value:.0f} misses the speed of waves of {wall}, T = {period:.3g} s, in water "
        "{depth:.3g} m deep (k d = {kd:.3g}) by {missed:.1%}: no order resolves them"
    ),
    "coarse-over-bed": (
        "cells of {value:.3g} m are coarse over this bed, and no accuracy is predicted: the rule (docs/plan.md) "
        "requires {limit:.2g} m"
    ),
    "low-order-over-bed": (
        "a vertical order of {value:.0f} is low over this bed, and no accuracy is predicted: the rule (docs/plan.md) "
        "requires {limit:.0f}"
    ),
    "step-misses-motion": (
        "the step of {dt:.3g} s is too long for the motion of {wall}: its displacement has an error of {value:.2g}"
    ),
    "unstable-at-stroke": (
        "at the largest displacement of the paddle the largest frequency of the mesh is up to {shift:.3g} times that "
        "at rest: the step of {value:.3g} s may be unstable there; numerics.dt = {limit:.2g} s is stable"
    ),
    "unstable-under-crests": (
        "under the highest crests dt omega_max is {value:.3g} times the limit of the scheme: above {limit:g} times it "
        "short waves grow there and the run is not accurate; numerics.dt = {longest:.2g} s prevents it"
    ),
    "less-accurate": "no planned numerics reach an accuracy of {limit:g}; these are planned for {value:g}",
    "copy-failed": "{key} could not be written ({reason}); {table} has the same",
}


@dataclass(frozen=True)
class RunWarning:
    """A warning of a run.

    Attributes
    ----------
    code
        Kind of the warning, a key of ``MESSAGES``.
    key
        Key of the case, or file, to which the warning refers.
    value, limit
        Value that exceeds its limit, and the limit, in the units of the sentence.
    t
        Time [s].
    x, y
        Position [m]; y in basins only.
    until
        Time [s] up to which the warning applies, if the run was resumed with other numerics.
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
    """Return the warning for a sentence, or for an entry of a manifest: a record or, in older ones, a sentence.

    A record whose template is missing or different in this version has its stored sentence as text.
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
    """Return the number of warnings of a run and the first of them, which is the most severe."""
    if not warnings:
        return "no warnings"
    return f"a warning: {warnings[0]}" if len(warnings) == 1 else f"{len(warnings)} warnings, the worst: {warnings[0]}"
