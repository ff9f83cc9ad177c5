"""What the water does in a run, as a study tables it: numbers by their names, and formulae of them."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from wavetank.analysis.quantities import AT_GAUGE, AT_WALL, OF_RUN, Findings
from wavetank.case import Scene
from wavetank.errors import InputError, choice
from wavetank.output.directory import RunDirectory
from wavetank.values.formula import CONSTANTS, FUNCTIONS, Formula

CREST, CREST_PLACE, CREST_TIME = "highest crest [m]", "crest's place x [m]", "crest's time [s]"
TROUGH = "deepest trough [m]"
USUAL = {CREST: "crest", CREST_PLACE: "crest_x", CREST_TIME: "crest_t", TROUGH: "trough"}
Responses = dict[str, float]
AT = AT_GAUGE | AT_WALL  # of quantities that belong to something

NAMED = re.compile(r"\s*([^=<>!@]+?)\s*=(?!=)(.+)")
QUANTITY = re.compile(r"(?<![\w.@'])([a-zA-Z][a-zA-Z0-9_]*)(?:@(?:'([^']+)'|([\w.]+)))?(?![\w(])")


@dataclass(frozen=True)
class Quantity:
    """A number of a run: what is meant by a name, and, where it is one at a gauge or on a wall, by that's."""

    name: str
    gauge: str | None = None

    @property
    def unit(self) -> str:
        """Its unit."""
        return (OF_RUN if self.gauge is None else AT)[self.name].unit

    def of(self, found: Findings) -> float:
        """Return it; raises ``InputError`` where the run does not tell it."""
        return OF_RUN[self.name].of(found) if self.gauge is None else AT[self.name].of(found, self.gauge)


class Response:
    """A column of a study: ``[NAME=]EXPRESSION``, an expression of quantities such as ``hm0@5 / hm0@1``.

    A quantity is a name, or ``NAME@GAUGE``; a gauge's name that is not letters, digits, points and _ is quoted. Raises
    ``InputError`` for what cannot be understood.
    """

    def __init__(self, text: str, label: str = ""):
        named = NAMED.fullmatch(text)
        expression = (named[2] if named else text).strip()
        self.quantities: list[Quantity] = []
        formula = QUANTITY.sub(self._variable, expression)
        if not self.quantities:
            raise InputError(f"response {text!r} received; {_allowed()}")
        self._names = [f"quantity{n}" for n in range(len(self.quantities))]
        self._formula = Formula(formula, variables=self._names)
        alone = formula == self._names[0]
        self.label = label or (named[1] if named else expression) + (f" [{self.quantities[0].unit}]" if alone else "")

    def _variable(self, found: re.Match[str]) -> str:
        name, gauge = found[1], found[2] or found[3]
        if gauge is None and (name in FUNCTIONS or name in CONSTANTS):
            return found[0]
        known = OF_RUN if gauge is None else AT
        if name not in known:
            why = choice(name, sorted(known))
            for kind, where in ((AT_GAUGE, "gauge"), (AT_WALL, "load")):
                why = f"; it is one of a {where}, {name}@{where.upper()}" if name in kind else why
            raise InputError(f"response {found.string.strip()!r}: {found[0]!r} is no quantity{why}.")
        self.quantities.append(Quantity(name, gauge))
        return f"quantity{len(self.quantities) - 1}"

    def check(self, scene: Scene) -> None:
        """Raise ``InputError`` for a gauge or load that a scene does not have."""
        gauges, loads = [gauge.name for gauge in scene.all_gauges], [load.called for load in scene.loads]
        for quantity in self.quantities:
            kind, have = ("load", loads) if quantity.name in AT_WALL else ("gauge", gauges)
            if quantity.gauge is not None and quantity.gauge not in have:
                others = ", ".join(have) or "none"
                raise InputError(f"response {self.label}: there is no {kind} {quantity.gauge!r}; there are {others}.")

    def of(self, found: Findings) -> float:
        """Return the response of a run; raises ``InputError`` where the run does not tell it."""
        return float(self._formula(*(np.float64(quantity.of(found)) for quantity in self.quantities)))


def _allowed() -> str:
    at = f"with @GAUGE {', '.join(AT_GAUGE)}, with @LOAD {', '.join(AT_WALL)}"
    return f"allowed are formulae of {', '.join(OF_RUN)}, and {at}."


def usual_responses(scene: Scene) -> list[Response]:
    """Return the highest elevation of all snapshots, where and when it stood, and but for a basin the lowest."""
    told = [label for label in USUAL if label != TROUGH or scene.tank.type != "basin"]
    return [Response(USUAL[label], label) for label in told]


def responses(
    run: RunDirectory, asked: Sequence[Response], *, start: float | None = None
) -> tuple[Responses, list[str]]:
    """Return a run's responses from a time [s] on by their labels, and why some are not a number, a sentence each."""
    found, told, causes = Findings(run, start=start), Responses(), list[str]()
    for one in asked:
        try:
            told[one.label] = one.of(found)
        except InputError as error:
            told[one.label] = np.nan
            causes.append(f"{one.label}: {error}")
    return told, causes


def responded(found: Iterable[Responses]) -> list[str]:
    """Return the responses that any run has."""
    return list(dict.fromkeys(name for one in found for name, value in one.items() if not np.isnan(value)))
