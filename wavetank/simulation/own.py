"""What users give of their own, an integrator or observers: held to its contract before a run begins."""

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


def own_scheme(given: Any) -> Integrator[Any]:
    """Return an integrator of a user's; raises ``InputError`` for what is none."""
    if isinstance(given, str):
        raise InputError(
            f"integrator = {given!r}: a name received; needed is a scheme of your own ({PAGE}): "
            "numerics.integrator of the scene takes the names of those that are there."
        )
    if isinstance(given, type):
        name = given.__name__
        raise InputError(f"integrator = {name}: a class received; needed is one of its objects, such as {name}().")
    _hold(given, SCHEME, "integrator", type(given).__name__)
    scheme: Integrator[Any] = given
    return scheme


def check_states(run: Run) -> None:
    """Raise ``InputError`` if the states of a run's integrator are none."""
    _hold(run.state, STATE, "integrator", f"what {run.integrator.name}.start returns")


class ObserverWaves:
    """The waves for observers of a user: evaluations use a separate history of solves, so that the run is unchanged."""

    def __init__(self, waves: AnyWaves):
        self._waves = waves

    def __getattr__(self, name: str) -> Any:
        method = getattr(self._waves, name)
        return partial(method, history=self._history) if name in SOLVING else method

    @cached_property
    def _history(self) -> Any:
        return self._waves.new_history("observers")


def own_observers(given: Sequence[Callable[[AnyWaves], Diagnostic]], waves: AnyWaves) -> list[Diagnostic]:
    """Return the observers that a user's functions make of the waves; raises ``InputError`` for what is none."""
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise InputError(f"observers = {_name(given)}: must be a list of functions of the waves, such as classes.")
    for n, one in enumerate(given):
        if not callable(one):
            what = f"a {type(one).__name__} received; needed is a function of the waves that returns one, or its class"
            raise InputError(f"observers[{n}]: {what} ({PAGE}).")
    own: Any = ObserverWaves(waves)
    return [_made(one, own, f"observers[{n}]") for n, one in enumerate(given)]


def called(given: Sequence[Callable[[AnyWaves], Diagnostic]]) -> list[str]:
    """Return what a user's functions of the waves are called."""
    return [_name(one) for one in given]


def _made(own: Callable[[AnyWaves], Diagnostic], waves: AnyWaves, where: str) -> Diagnostic:
    try:
        observer = own(waves)
    except Exception as error:
        locate(error, f"{where}, {_name(own)}")
        raise
    _hold(observer, DIAGNOSTIC, where, f"what {_name(own)} returns")
    return observer


def _hold(given: Any, needed: Sequence[str], where: str, what: str) -> None:
    if missing := [name for name in needed if not hasattr(given, name)]:
        raise InputError(f"{where}: {what} has no {', '.join(missing)}; needed are {', '.join(needed)} ({PAGE}).")


def _name(given: Any) -> str:
    return str(getattr(given, "__name__", type(given).__name__))
