"""Users' integrators and observers, checked for the required attributes before a run begins."""

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any

from wavetank.base.errors import InputError, locate
from wavetank.integrators.contract import Integrator
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.contract import Diagnostic
from wavetank.simulation.run import Run

SCHEME = ("name", "order", "stability_limit", "frequency_error", "nodes", "start", "step")
STATE = ("q", "p", "evaluations", "evaluated", "q_jump", "mapped")
DIAGNOSTIC = ("schedule", "record")
SOLVING = ("evaluate", "solve_stage", "solve_stages")
PAGE = "docs/extend.md"
Observers = Sequence[Callable[[AnyWaves], Diagnostic]]
"""Functions of the waves that return a user's diagnostics, such as classes."""


def own_scheme(given: Any) -> Integrator[Any]:
    """Return the integrator of a user; raises ``InputError`` for any other object."""
    if isinstance(given, str):
        raise InputError(
            f"integrator = {given!r}: a name received; must be an integrator object ({PAGE}): "
            "the case key numerics.integrator selects an integrator by name."
        )
    if isinstance(given, type):
        name = given.__name__
        raise InputError(f"integrator = {name}: a class received; must be an object, such as {name}().")
    _check_attributes(given, SCHEME, "integrator", type(given).__name__)
    scheme: Integrator[Any] = given
    return scheme


def check_states(run: Run) -> None:
    """Raise ``InputError`` if the state of a run's integrator lacks attributes."""
    _check_attributes(run.state, STATE, "integrator", f"what {run.integrator.name}.start returns")


class ObserverWaves:
    """The waves for users' observers: evaluations use a separate history of solves, so that the run is unchanged."""

    def __init__(self, waves: AnyWaves):
        self._waves = waves

    def __getattr__(self, name: str) -> Any:
        method = getattr(self._waves, name)
        return partial(method, history=self._history) if name in SOLVING else method

    @cached_property
    def _history(self) -> Any:
        return self._waves.new_history("observers")


def own_observers(given: Observers, waves: AnyWaves) -> list[Diagnostic]:
    """Return the observers that a user's functions of the waves return; raises ``InputError`` for other objects."""
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise InputError(f"observers = {called(given)}: must be a list of functions of the waves, such as classes.")
    for n, one in enumerate(given):
        if not callable(one):
            what = f"a {type(one).__name__} received; must be a function of the waves or a class"
            raise InputError(f"observers[{n}]: {what} ({PAGE}).")
    own, result = ObserverWaves(waves), list[Any]()
    for n, one in enumerate(given):
        where = f"observers[{n}]"
        try:
            result.append(one(own))  # type: ignore[arg-type]
        except Exception as error:
            locate(error, f"{where}, {called(one)}")
            raise
        _check_attributes(result[-1], DIAGNOSTIC, where, f"what {called(one)} returns")
    return result


def _check_attributes(given: Any, needed: Sequence[str], where: str, what: str) -> None:
    if missing := [name for name in needed if not hasattr(given, name)]:
        raise InputError(f"{where}: {what} has no {', '.join(missing)}; needed are {', '.join(needed)} ({PAGE}).")


def called(given: Any) -> str:
    """Return the name of a user's function or class, or of the class of an object."""
    return str(getattr(given, "__name__", type(given).__name__))
