"""The last lines of a run, against its records."""

import numpy as np
import pytest

from wavetank.simulation.diagnostics import Crest
from wavetank.simulation.summary import RunOutcome, closing

SHORT = ("run.duration=0.4", "numerics.cells=8", "numerics.vertical_order=4", "numerics.dt=0.02")
SPENT = {
    "scene": {"run": {"duration": 10.0}},
    "parts": [{"ranks": 3}],
    "t": 10.0,
    "timings": {"stepping_s": 5.0, "stepping_cpu_s": 12.0},
    "numerics": {"steps_taken": 100, "dt": 0.1},
    "counters": {"interior_solves": 456},
    "checkpoints": [10.0, 9.0],
}


def test_a_run_ends_with_what_its_records_say_on_any_number_of_ranks(recorded_on_ranks):
    """The wave begins to run up at the tank's ends, where gauges are."""
    start = 'initial={type="formula", eta="0.1*cos(pi*x) + 0.001*x", psi="0.4*cos(pi*x)"}'  # one end higher
    alone, together = recorded_on_ranks("cases/standing-wave.toml", *SHORT, "water.type=linear", start)
    crest, errors = alone.manifest["highest_crest"], alone.manifest["errors"]
    at = alone.gauges.swap_dims(gauge="x").sel(x=crest["x"])
    assert crest["height"] == pytest.approx(float(at.max()), rel=1e-9) and crest["height"] > 0.11
    assert crest["t"] == at.idxmax("time") > 0.0
    energy = {name: column.values for name, column in alone.energy.items()}
    assert errors["mass"] == pytest.approx(np.abs(energy["mass"] / energy["mass"][0] - 1).max(), abs=1e-17)
    assert errors["energy_balance"] == pytest.approx(np.abs(energy["balance"]).max() / energy["total"].max(), rel=1e-9)
    assert together.manifest["highest_crest"] == pytest.approx(crest, rel=1e-6)
    for run, ranks in ((alone, "1 rank"), (together, "3 ranks")):
        *lines, last = (run.path / "run.log").read_text().splitlines()[-6:]
        place = f"at the node x = {crest['x']:.4g} m, t = {crest['t']:.4g} s"
        assert lines[0] == f"highest crest: {crest['height']:.4g} m, {place}"
        assert lines[1].startswith("errors: ") and lines[1].endswith(" of the energy; no warnings")
        assert lines[2].startswith("cost: ") and f" CPU s on {ranks}, 20 steps, " in lines[2]
        assert lines[3:] == [
            f"records: {run.path}",
            f"next: wavetank view {run.path}; wavetank compare {run.path} --with DATA",
        ]
        assert last == "finished"
        slower = "\na slice or ring wants one rank, whose solves are compiled: 3 take many times as long\n"
        assert (slower in (run.path / "run.log").read_text()) is (run is together)


BROKEN = {"t": 9.9, "checkpoints": [9.0, 6.0], "broke_down": {"crests": []}}
DAMPED = SPENT["scene"] | {"run": SPENT["scene"]["run"] | {"on_breaking": "dissipate"}}
FAST = {"checkpoints": [], "broke_down": {"crests": [{"speed_ratio": 0.9}]}}
ANEW = "anew from the start"
ENDED = [  # what differs from a finished run, since when it is untrue [s], what to do next
    ({"t": 4.0}, None, "wavetank resume {}"),
    ({"t": 4.0, "anew": True}, None, f"{ANEW}, as the case has to be another"),
    ({"t": 4.0, "unwritten": True}, None, "wavetank resume {}, once it can be written there again"),
    ({"t": 4.0, "checkpoints": []}, None, f"{ANEW}: there is no checkpoint"),
    (BROKEN, None, "wavetank resume {} --set numerics.dt=0.05"),
    (BROKEN, 9.2, "wavetank resume {} --set numerics.dt=0.05"),
    (BROKEN, 8.5, "wavetank resume {} --at 6 --set numerics.dt=0.05"),
    (BROKEN, 5.0, f"{ANEW} with --set numerics.dt=0.05: no"),
    (BROKEN | {"anew": True}, None, f"{ANEW}, as the case has to be another"),
    (BROKEN | {"checkpoints": [], "cure": "numerics.tolerance=1e-05"}, None, f"{ANEW} with --set numerics.tolerance"),
    (FAST, None, f"{ANEW} with --set run.on_breaking=dissipate: there is no checkpoint"),
    (FAST | {"cure": "numerics.dt=0.03"}, None, f"{ANEW} with --set run.on_breaking=dissipate --set numerics.dt=0.03"),
    (FAST | {"scene": DAMPED}, None, f"{ANEW} with --set numerics.dt=0.05: there is no checkpoint"),
]


@pytest.mark.parametrize(("ended", "untrue", "said"), ENDED)
def test_last_line_says_how_a_run_that_ends_early_goes_on(tmp_path, ended, untrue, said):
    outcome = RunOutcome(Crest(0.1131, 10.46, -2.0, 20.18), 2e-15, 3.4e-5, untrue)
    *_, last = closing(outcome, SPENT | ended, warnings=["it is off"], path=tmp_path, flat=True)
    assert last.startswith("next: " + said.format(tmp_path))
