"""A wave train released from rest over a bed of varying depth, against Whispers3D (Coulaud et al. 2025, case 2).

Whispers3D solves the same equations, fully nonlinear potential flow, by other means. Its envelope was digitised from
two figures, to about 1 mm; from x = 30 to 60 m both of its curves sink by the same 1.4 mm.
"""

from pathlib import Path

import numpy as np
import pytest
from conftest import needs_data
from mpi4py import MPI

from wavetank import data
from wavetank.case.reading import read_case
from wavetank.output.columns import energy_columns
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.records import Memory, Records

CASE = Path(__file__).resolve().parents[1] / "cases" / "shoaling-release.toml"
REFERENCE = "whispers3d_coulaud_case2_shoaling"
FILES = [  # Whispers3D, and the Madsen-Sorensen equations of the same paper
    ("solutions_up_to_30m_A2.csv", "solutions_up_to_30m_MS.csv"),
    ("solutions_beyond_30m.csv", "solutions_beyond_30m_MS.csv"),
]
NOISE = 1.3e-3  # m, of the digitised curves, their sinking included: 2 % of the envelope's root mean square


class Envelope:
    """The highest and the lowest elevation of all snapshots."""

    def __init__(self, x=None, highest=-np.inf, lowest=np.inf):
        self.x, self.highest, self.lowest = x, highest, lowest

    @classmethod
    def read(cls, file):
        table = np.loadtxt(data.find(REFERENCE, file), delimiter=",", skiprows=1)
        return cls(*table[np.argsort(table[:, 0], kind="stable")].T)

    def extend(self, rows):
        x, eta, _ = np.split(rows[:, 1:], 3, axis=1)
        self.x = x[-1]
        self.highest = np.maximum(self.highest, eta.max(axis=0))
        self.lowest = np.minimum(self.lowest, eta.min(axis=0))

    def errors(self, other):
        """Return the root mean square difference of the highest and the lowest at the other's places [m]."""
        highest = np.interp(other.x, self.x, self.highest) - other.highest
        lowest = np.interp(other.x, self.x, self.lowest) - other.lowest
        return np.sqrt([(highest**2).mean(), (lowest**2).mean()])


@pytest.mark.slow
def test_the_envelope_is_that_of_fully_nonlinear_potential_flow():
    """And it is not just any model's: the crests of a Boussinesq model are off by five times as much and more."""
    for file in sum(FILES, ()):
        needs_data(REFERENCE, file)
    case = read_case(CASE, ["output.surface_every=0.01"])
    envelope, energy = Envelope(), Memory()
    run, waves = build_run(case, MPI.COMM_SELF)
    run.diagnostics += build_observers(case, waves, Records(Memory(), energy, envelope), sinks=run.sinks)
    run.execute()
    for potential_flow, boussinesq in FILES:
        published = Envelope.read(potential_flow)
        errors = envelope.errors(published)
        assert (errors < NOISE).all()
        assert Envelope.read(boussinesq).errors(published)[0] > 5 * errors[0]
    budget = dict(zip(energy_columns(1), energy.array().T, strict=True))
    assert np.abs(budget["mass [m^2]"] / budget["mass [m^2]"][0] - 1).max() < 1e-13
    assert np.abs(budget["balance [m^4/s^2]"]).max() < 3e-4 * budget["total [m^4/s^2]"][0]  # the scheme's, at this step
