"""``wavetank analyse RUN|DATA KIND``. Imports are inside the command, so that this module loads fast."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from wavetank import data
from wavetank.base.console import console
from wavetank.base.errors import InputError, choice, write_errors
from wavetank.base.run_warning import summarise_warnings
from wavetank.output.files import check_new, write_atomically
from wavetank.output.manifest import MANIFEST

KINDS = ("spectrum", "heights", "harmonics", "bound-free", "groups", "reflection", "speed", "calibration")
WIDTH = 128  # least width of a table in characters
MOST = 24  # rows of a table on the terminal
CALIBRATION = "calibration"
REFLECTION = "reflection"  # kinds for regular waves, or for a sea
REGULAR = ("harmonics", "bound-free", REFLECTION, "speed")  # kinds with a period


def analyse(
    source: Annotated[str, typer.Argument(help="run directory, CSV file, or data set", metavar="RUN|DATA")],
    kinds: Annotated[
        list[str] | None, typer.Argument(help=f"{', '.join(KINDS)}; default: {KINDS[0]}", metavar="[KIND]...")
    ] = None,
    start: Annotated[float | None, typer.Option(help="from when [s]")] = None,
    end: Annotated[float | None, typer.Option(help="till when [s]")] = None,
    gauges: Annotated[str | None, typer.Option(metavar="NAME,NAME,...", help="of these gauges alone")] = None,
    along: Annotated[
        str | None, typer.Option(metavar="X,X,NUMBER", help="a slice's surface at so many places from x to x [m]")
    ] = None,
    period: Annotated[
        float | None,
        typer.Option(help="of regular waves [s]; default: the paddle's, or found, and for reflection a sea", min=1e-6),
    ] = None,
    sea: Annotated[
        bool, typer.Option("--sea", help="reflection of all frequencies, though the paddle has a period")
    ] = False,
    parts: Annotated[
        str | None,
        typer.Option(metavar="gain,clock,place", help="what a calibration fits; default: all. Other parts are 0"),
    ] = None,
    corrections: Annotated[
        Path | None, typer.Option(help="file with corrections of gauges, as a calibration writes it")
    ] = None,
    depth: Annotated[float | None, typer.Option(help="of still water [m]; a run's is known", min=1e-6)] = None,
    out: Annotated[Path | None, typer.Option(help="folder; default: the run's, or runs/ and the data's name")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace analyses that are there (--out)")] = False,
) -> None:
    """Analyse gauges: spectra, heights, harmonics, reflection.

    Each kind has a table and a picture: spectra with Hm0, Tp, Tm02; heights of individual waves; harmonics of regular
    waves; bound and free second harmonics; groups; incident and reflected waves; speed between gauges; gains, clocks
    and places of gauges.
    """
    chosen = list(dict.fromkeys(kinds or KINDS[:1]))
    for kind in chosen:
        if kind not in KINDS:
            raise InputError(f"analysis {kind!r} received{choice(kind, KINDS)}.")
    if period is not None and not set(chosen) & set(REGULAR):
        raise InputError(f"--period received with {', '.join(chosen)}; it is for {', '.join(REGULAR)}.")
    if sea and REFLECTION not in chosen:
        raise InputError(f"--sea received with {', '.join(chosen)}; it is for {REFLECTION}.")
    if sea and period is not None and not {*chosen} & {*REGULAR} - {REFLECTION}:
        raise InputError(f"--sea and --period {period:g} received; {REFLECTION} is of one of them.")
    if parts is not None and CALIBRATION not in chosen:
        raise InputError(f"--parts received with {', '.join(chosen)}; it is for {CALIBRATION}.")
    folder = own_folder(source) if out is None else out
    files = {kind: folder / f"analysis-{kind}.csv" for kind in chosen}
    siblings = [file.with_suffix(".png") for file in files.values()]
    siblings += [files[kind].with_suffix(".toml") for kind in chosen if kind == CALIBRATION]
    check_new(*files.values(), *siblings, overwrite=overwrite or out is None)
    names = tuple(name.strip() for name in gauges.split(",")) if gauges else ()
    from wavetank.analysis.record import read_record
    from wavetank.analysis.results import analysed
    from wavetank.plots.analysis_figures import result_figure
    from wavetank.plots.tables import data_frame, plain_columns, terminal_table, write_frame

    record = read_record(
        source,
        start=start,
        end=end,
        gauges=names,
        along=_places(along),
        depth=depth,
        period=period,
        parts=_parts(parts),
        corrections=corrections,
    )
    records = {REFLECTION: replace(record, given_period=None)} if sea else {}
    results, refused = {}, dict[str, list[str]]()
    for kind in chosen:
        try:
            results[kind] = analysed(kind, records.get(kind, record))
        except InputError as error:
            refused.setdefault(str(error), []).append(kind)
    why = InputError(" ".join(f"{', '.join(of)}: {reason}" for reason, of in refused.items()))
    if not results:
        raise why
    with write_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    terminal = console(least=WIDTH)
    if record.cause:
        terminal.print(f"the run has not finished: {record.cause}", highlight=False, markup=False)
    if record.warnings:
        terminal.print(f"the run has {summarise_warnings(record.warnings)}", highlight=False)
    if units := data.units_note(source):
        terminal.print(units, highlight=False)
    for kind, result in results.items():
        table = data_frame(result.columns)
        more = f"and {len(table) - MOST} more rows, in the file" if len(table) > MOST else None
        shown = plain_columns(table, digits=3 if kind == CALIBRATION else 4)
        terminal.print(terminal_table(table[:MOST], shown, caption=more))
        if result.text:
            terminal.print(result.text, highlight=False)
        replaced = ", in place of what was there (--out: elsewhere)" if files[kind].exists() else ""
        write_frame(files[kind], table)
        picture = result_figure(result, files[kind].with_suffix(".png"))
        written = [files[kind], picture]
        if result.toml:
            written.insert(1, files[kind].with_suffix(".toml"))
            with write_errors(written[1]):
                write_atomically(written[1], result.toml.encode())
        terminal.print(f"wrote {', '.join(map(str, written[:-1]))} and {picture}{replaced}", highlight=False)
    if refused:
        raise why


def own_folder(source: str) -> Path:
    """Return the folder for results: of a run its directory, of a table or data set a folder in ``runs``."""
    path = Path(source)
    if (path / MANIFEST).is_file():
        return path
    from wavetank.data.description import DATASET

    described = path.parent if path.name == DATASET else path
    return Path("runs") / f"{described.name.partition('.')[0].replace(':', '-')}-analysis"


def _parts(text: str | None) -> tuple[str, ...]:
    """Return the parts of a text with commas, default: all; raise ``InputError`` for others."""
    from wavetank.analysis.calibration import PARTS

    parts = PARTS if text is None else tuple(part.strip() for part in text.split(","))
    if other := [part for part in parts if part not in PARTS]:
        raise InputError(f"--parts: {other[0]!r} received; allowed are {', '.join(PARTS)}.")
    return parts


def _places(text: str | None) -> tuple[float, float, int] | None:
    """Return first and last position [m] and the number of ``X,X,NUMBER``; raise ``InputError`` for other texts."""
    if text is None:
        return None
    try:
        first, last, number = text.split(",")
        result = float(first), float(last), int(number)
    except ValueError:
        result = (0.0, 0.0, 0)
    if not (result[0] < result[1] and 2 <= result[2] <= 2000):
        raise InputError(f"along {text!r} received; allowed is X,X,NUMBER: from x to x [m], 2 to 2000 places: 5,20,60.")
    return result
