"""A numerical wave tank: fully nonlinear potential-flow water waves from Miles' variational principle on FEniCSx.

    import wavetank as wt

    case = wt.read_case("cases/focusing.toml", ["run.duration=30"])
    run = wt.run(case, "runs/focusing")
    run.gauges, run.energy, run.paddle, run.surface      # xarray; wt.open_run("runs/focusing") has them later
    wt.resume("runs/focusing", extend=10)                # and goes on

What is not in ``__all__`` may change; what loads long, dolfinx first, is loaded when it is needed.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from wavetank.base.working_directory import check_working_directory

if TYPE_CHECKING:
    from wavetank.case.reading import read_case
    from wavetank.output.directory import open_run
    from wavetank.recording.public import resume, run

__version__ = "0.1.0"
__all__ = ["open_run", "read_case", "resume", "run"]

HOMES = {
    "open_run": "wavetank.output.directory",
    "read_case": "wavetank.case.reading",
    "resume": "wavetank.recording.public",
    "run": "wavetank.recording.public",
}


def __getattr__(name: str) -> Any:
    if name in HOMES:
        check_working_directory()
        return getattr(import_module(HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
