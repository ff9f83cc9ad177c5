"""The same cases by this checkout and by another, in turn: ratios of CPU time, in which noise cancels.

git worktree add ../before REVISION
./env python -m benchmarks --only beside --other ../before
"""

import json
import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

HERE = Path(__file__).resolve().parent.parent
CASES = {  # and what is set of them
    "marin-202002": ("run.duration=20",),
    "focusing": (),
}
WARM = ("run.duration=0.2",)


def report(other: Path, console: Console, *, cases: list[str] | None = None) -> None:
    """Print the CPU time of steps and process of each case in both checkouts."""
    table = Table("case", "checkout", "CPU s of the steps", "of the process", "ratio of both", title=f"beside {other}")
    for case in cases or CASES:
        for checkout in (other, HERE):
            spent(checkout, case, WARM)  # compiles what is not kept
        theirs, ours = spent(other, case, CASES[case]), spent(HERE, case, CASES[case])
        table.add_row(case, str(other), *(f"{value:.2f}" for value in theirs))
        ratios = ", ".join(f"{before / now:.2f}" for before, now in zip(theirs, ours, strict=True))
        table.add_row("", "here", *(f"{value:.2f}" for value in ours), ratios)
    console.print(table)


def spent(checkout: Path, case: str, settings: Sequence[str]) -> tuple[float, float]:
    """Return CPU seconds of the steps of a case and of its process, without pictures."""
    changes = [part for setting in settings for part in ("--set", setting)]
    surroundings = {name: value for name, value in os.environ.items() if name not in {"WAVETANK_INSIDE", "PYTHONPATH"}}
    with tempfile.TemporaryDirectory() as folder:
        out, began = Path(folder) / "run", os.times()
        command = ["./env", "wavetank", "run", f"cases/{case}.toml", "--no-plots", "--out", str(out), *changes]
        subprocess.run(command, cwd=checkout, env=surroundings, check=True, stdout=subprocess.DEVNULL)
        ended, manifest = os.times(), json.loads(next(out.glob("manifest*")).read_text(encoding="utf-8"))
    process = ended.children_user + ended.children_system - began.children_user - began.children_system
    return manifest["timings"]["stepping_cpu_s"], process
