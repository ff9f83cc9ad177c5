"""The command line. Exit codes: 0 success; 1 the run failed; 2 the input is invalid."""

import inspect
import json
import os
import shlex
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import cache, wraps
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from wavetank import __version__, data
from wavetank.base.console import console
from wavetank.base.errors import InputError, WavetankError, printable
from wavetank.base.mpi import MPI, all_ranks_arrive, on_first
from wavetank.base.python_file import trusting
from wavetank.case.new import KINDS, cases_at_hand, write_case
from wavetank.output.commands import export, status
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.planning.command import motion, plan
from wavetank.plots.analyse_command import analyse
from wavetank.plots.view_command import view
from wavetank.studies.command import calibrate, study, validate
from wavetank.studies.compare_command import compare

Trust = Annotated[bool, typer.Option("--trust", help="execute the Python files that the case or the run names")]


def may_execute(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the option ``--trust``; without this option it executes no Python file."""

    @wraps(command)
    def trusted(*, trust: bool = False, **options: Any) -> None:
        with trusting(trust, lambda sentence: console().print(sentence, highlight=False)):
            command(**options)

    signature = inspect.signature(command)
    added = inspect.Parameter("trust", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Trust)
    trusted.__dict__["__signature__"] = signature.replace(parameters=[*signature.parameters.values(), added])
    trusted.__annotations__ = {**command.__annotations__, "trust": Trust}
    return trusted


def example(words: str) -> str:
    """Return the last line of the help of a command."""
    return f"Example: wavetank {words}"


HELP = "A numerical wave tank: fully nonlinear potential-flow water waves."
INSTALL = (
    "this command needs FEniCSx (dolfinx >= 0.9, petsc4py, mpi4py) and gmsh: from conda (environment.yml), "
    "from apt (python3-dolfinx, python3-gmsh), or by ./env in a checkout."
)
SOLVER = {"mpi4py", "petsc4py", "dolfinx", "ufl", "basix", "ffcx", "cffi", "gmsh"}  # not installed by pip
INTERRUPTED = 130  # exit code of typer after Ctrl-C before or after the steps of a run
LAST_RANK = 60.0  # time within which all ranks must arrive at the exit [s]
OVERWRITE = "replace the files that an earlier command wrote there"
Plots = Annotated[bool, typer.Option(help="draw the standard plots at the end")]
Yes = Annotated[bool, typer.Option("--yes", help="accept a run of days, or one that needs more memory than available")]
app = typer.Typer(
    help=HELP,
    epilog=example("run cases/focusing.toml"),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
data_app = typer.Typer(
    help="Benchmark data: download with checksum, or use a local folder.",
    epilog=example("data list"),
    no_args_is_help=True,
)
verify_app = typer.Typer(
    help="Recompute results of the literature on the method.", epilog=example("verify sponge"), no_args_is_help=True
)


def _print_version(requested: bool) -> None:
    if requested:
        console().print(f"wavetank {__version__}", highlight=False)
        raise typer.Exit


@app.callback(help=HELP)
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="print the version")
    ] = False,
) -> None:
    """Take the options of all commands."""


def new(
    name: Annotated[str, typer.Argument(help="name of the case; NAME.toml must not exist")],
    kind: Annotated[str, typer.Option(metavar="|".join(KINDS), help="kind of experiment")] = KINDS[0],
) -> None:
    """Write a new case as a starting point; it runs in seconds."""
    path = on_first(MPI.COMM_WORLD, lambda: write_case(name, kind))
    console().print(f"wrote {path}; now: wavetank run {shlex.quote(str(path))}", highlight=False)


@may_execute
def run(
    case_file: Annotated[
        Path | None, typer.Argument(help="case file (TOML); default: list the available cases", metavar="CASE")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="run directory; default runs/ and the case's name, with a number if it exists")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help=OVERWRITE)] = False,
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change the case")] = None,
    plots: Plots = True,
    yes: Yes = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="resume the run in the directory from its last checkpoint")
    ] = False,
    certify: Annotated[
        bool, typer.Option("--certify", help="estimate the numerical uncertainty; same as numerics.certify=true")
    ] = False,
    budget: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="largest CPU time, of all runs for an accuracy", min=0.1)
    ] = None,
) -> None:
    """Run a case; also under mpirun."""
    if case_file is None:
        _list_cases()
        raise typer.Exit(2)  # no run
    if resume and overwrite:
        raise InputError("--resume and --overwrite exclude each other: a run is resumed or replaced.")
    if resume and budget is not None:
        raise InputError("--resume and --budget exclude each other: a resumed run keeps its numerics.")
    from wavetank.case.reading import located, read_case

    overrides = [*(overrides or []), *(["numerics.certify=true"] if certify else [])]
    case = read_case(case_file, overrides)
    place = OutputPath.of(out, Path("runs") / case_file.stem, overwrite=overwrite or resume)
    from wavetank.recording.accuracy import record_to_accuracy

    with located(case_file, overrides):
        draw, terminal = _draw if plots else None, console()
        options = {"draw": draw, "accept_cost": yes}
        record_to_accuracy(case, place, comm=MPI.COMM_WORLD, console=terminal, budget=budget, resume=resume, **options)


@may_execute
def resume(
    directory: Annotated[
        Path, typer.Argument(help="run directory, which contains the case", metavar="RUN", readable=False)
    ],
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change numerics or records")
    ] = None,
    extend: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="additional duration, also of a finished run")
    ] = None,
    at: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="time of the checkpoint, one of the two in the directory")
    ] = None,
    plots: Plots = True,
    yes: Yes = False,
) -> None:
    """Resume a run from its last checkpoint, or from the one before."""
    from wavetank.recording import resume_run

    options = {"draw": _draw if plots else None, "accept_cost": yes}
    resume_run(directory, overrides or [], extend=extend, at=at, comm=MPI.COMM_WORLD, console=console(), **options)


def _list_cases() -> None:
    terminal = console()
    terminal.print("Usage: wavetank run CASE. Available cases (wavetank new writes a new one):", highlight=False)
    for path, title in cases_at_hand():
        terminal.print(f"  {path!s:30}  {title}", highlight=False)


def _draw(directory: RunDirectory) -> list[Path]:
    from wavetank.plots.figures import draw_run

    return draw_run(directory)


def schema(
    reference: Annotated[
        bool, typer.Option("--reference", help="print the reference page docs/reference.md instead")
    ] = False,
) -> None:
    """Print the JSON schema of cases, for completion in editors."""
    from wavetank.case import reference as page
    from wavetank.case import schema as rules

    text = page.reference() if reference else json.dumps(rules.schema(), indent=1) + "\n"
    console().out(text, highlight=False, end="")


@data_app.command("list", epilog=example("data list"))
def list_data() -> None:
    """List the known data sets: location, source, licence."""
    terminal = console()
    for name in data.names():
        terminal.print(data.summary(name), highlight=False)


@data_app.command(epilog=example("data fetch marin-202002"))
def fetch(name: Annotated[str, typer.Argument(help="name of the data set", metavar="NAME")]) -> None:
    """Download a data set from its public source into the user's cache."""
    folder = data.fetch(name)
    console().print(f"{name} is in {folder}", highlight=False)


CHECKOUT = Path(__file__).resolve().parents[1]
VERIFICATIONS = {  # module of ``examples.paper`` that writes tables and figures: its help
    "integrators": "Recompute every table and figure on the integrators.",
    "extremes": "Measure growing modes, steepness, breaking; two hours.",
    "sponge": "Measure what a sponge reflects; two minutes.",
    "second_order": "Measure the free waves that a paddle makes; minutes.",
    "measured_flap": "Compare the waves of a measured flap; minutes.",
    "focused_group": "Compare a focused group with third-order theory.",
    "cylinder": "Compare run-up on a cylinder with McCamy and Fuchs.",
    "directional_focus": "Compare directional waves with linear theory.",
    "certificate": "Compare numerical uncertainties with errors; minutes.",
    "delivery": "Compare requested accuracies with errors; minutes.",
    "trade": "Compare predicted errors and costs with runs; minutes.",
    "layouts": "Draw the layouts of basins; seconds.",
}


def _add_verification(name: str, meaning: str) -> None:
    shown = name.replace("_", "-")

    def verify(
        out: Annotated[
            Path | None, typer.Option(help=f"output folder; default runs/{shown}, with a number if it exists")
        ] = None,
        overwrite: Annotated[bool, typer.Option("--overwrite", help=OVERWRITE)] = False,
        seed: Annotated[
            int, typer.Option(help="seed of the first random case (certificate, delivery, trade)", min=0)
        ] = 0,
    ) -> None:
        if not (CHECKOUT / "examples" / "paper").is_dir():
            raise InputError("verify needs a checkout of the project: examples/paper is not installed.")
        sys.path.insert(0, str(CHECKOUT))  # before the current directory, which may contain another ``examples``
        module: Any = import_module(f"examples.paper.{name}")
        report: Any = import_module("examples.paper.report")
        place = OutputPath.of(out, Path("runs") / shown, overwrite=overwrite)
        on_first(MPI.COMM_WORLD, lambda: report.write(module, place.folder(), console(), seed))

    verify_app.command(shown, help=meaning, epilog=example(f"verify {shown} --out runs/{shown}"))(verify)


COMMANDS: dict[Callable[..., None], str] = {  # in the order of use, each with an example
    new: "new waves --kind focus",
    may_execute(plan): "plan cases/wavemaker.toml --accuracy 0.01",
    may_execute(motion): "motion cases/focusing.toml --rate 200",
    run: "run cases/focusing.toml --set numerics.cell_size=0.1",
    resume: "resume runs/focusing --extend 30",
    status: "status runs",
    may_execute(view): "view runs/focusing --film runs/focusing/view.mp4",
    may_execute(compare): "compare runs/marin-202002 --with marin-202002",
    may_execute(validate): "validate marin-202002",
    may_execute(analyse): "analyse runs/focusing spectrum groups",
    may_execute(study): "study cases/standing-wave.toml --sweep dt=0.02,0.01",
    may_execute(calibrate): "calibrate cases/focusing.toml",
    export: "export runs/mine inlet --to openfoam --spacing 0.01",
    schema: "schema > case.schema.json",
}
for _command, _words in COMMANDS.items():
    app.command(epilog=example(_words))(_command)
for _name, _meaning in VERIFICATIONS.items():
    _add_verification(_name, _meaning)
app.add_typer(data_app, name="data")
app.add_typer(verify_app, name="verify")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return its exit code."""
    os.environ.setdefault("PETSC_OPTIONS", "-no_signal_handler")  # Python reports a closed pipe and Ctrl-C
    given, ranks = sys.argv[1:] if arguments is None else arguments, _ranks()
    sys.argv = [word.encode(errors="backslashreplace").decode() for word in sys.argv]  # dolfinx reads them as UTF-8
    try:
        app([word for word in given if word != "--debug"])
    except (SystemExit, KeyboardInterrupt) as stop:
        if isinstance(stop, SystemExit) and stop.code != INTERRUPTED:
            return int(stop.code or 0)
        _print_error("interrupted by SIGINT")
        if ranks.size > 1:
            ranks.Abort(1)  # the others may be at any point of the program
        return 1
    except Exception as error:
        explanation = None if "--debug" in given else _explanation(error)
        if explanation is None or not isinstance(error, WavetankError | ModuleNotFoundError):
            _abort(error)
        if explanation is None:
            raise
        return _report(*explanation, ranks)
    return 0


def _explanation(error: Exception) -> tuple[str, int] | None:
    """Return the message and the exit code of an error; None for a defect of the program."""
    if isinstance(error, WavetankError):
        return str(error), error.exit_code
    if isinstance(error, ModuleNotFoundError) and (missing := (error.name or "").partition(".")[0]) in SOLVER:
        return f"{missing} is not installed; {INSTALL}", 2
    if isinstance(error, MemoryError):
        return "not enough memory; a smaller case or a larger machine is needed.", 1
    if isinstance(error, OSError):  # such as a full disk or a deleted folder
        return f"{error.filename or 'a file'}: {error.strerror or error}.", 1
    return None


@cache
def _ranks() -> MPI.Comm:
    """Return a communicator of all ranks for the exchange at exit, separate from messages elsewhere."""
    return MPI.COMM_WORLD.Dup()


def _report(message: str, code: int, ranks: MPI.Comm) -> int:
    """Print the error, and wait for all ranks: mpirun kills the others as soon as one rank exits with an error.

    If the others do not arrive in time, this rank prints its own message and aborts all ranks.
    """
    if ranks.rank == 0:
        _print_error(message)
    if not all_ranks_arrive(ranks, LAST_RANK):
        if ranks.rank:
            _print_error(f"rank {ranks.rank}: {message}")
        ranks.Abort(code)
    return code


def _print_error(message: str) -> None:
    with suppress(OSError):  # stderr may be closed
        print(f"wavetank: {printable(message)}", file=sys.stderr, flush=True)


def _abort(error: BaseException) -> None:
    """Abort all ranks if there are several: the others would wait for the one that failed."""
    if MPI.COMM_WORLD.size > 1:
        traceback.print_exception(error)
        MPI.COMM_WORLD.Abort(1)
