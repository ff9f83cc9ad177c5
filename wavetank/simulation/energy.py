"""The energy budget: energy of the water, work of the paddles, dissipation, and their balance.

The power of a paddle is exact for the discrete Hamiltonian: along the flow dH/dt = dH/dt|explicit, so with E = H - W

    E(t) - E(0) = int_0^t dH/dt|explicit dt' - [W]_0^t  =  paddle work.

It is integrated over all steps (``supply.py``), also those that are not recorded. The same holds for the power that a
sponge dissipates, gamma psi H_psi. Filters between steps count their own dissipation. The balance, E - E(0) - work +
dissipated, is the error of the time integrator. A scheme that reports the mean of two traces evaluates these traces.
The power is the mean of both. H of the mean is that of the plus trace, with its derivatives times the offset
(``tank/block.py``). Both are accurate to the square of the jump. With a filter between steps the minus trace is that
before the filter, and the plus trace that after it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.base.run_warning import RunWarning
from wavetank.output.columns import energy_rows
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.contract import Waves
from wavetank.simulation.records import Record
from wavetank.simulation.supply import Integral
from wavetank.tank.block import Block
from wavetank.tank.dissipation import Smoothing

ROUNDING = 1e-12  # energy below which values are round-off, relative to g d² of the tank
BALANCE_LIMIT = 0.01  # error of the balance for a warning, relative to the energy, with dissipated and absorbed parts
GAIN_LIMIT = 1e-3  # gain by a dissipating part for a warning, relative to the energy
CAUSE_PART = 0.2  # gain by such a part that counts as a cause, relative to the error of the balance
LOSS_LIMIT = 0.01  # numerical loss for a warning, relative to the energy; twice the relative loss of height

SPONGE = "the sponge"
GAIN_CAUSES = (
    "possible causes are waves far longer than the sponge, as in front of a group (a longer sponge reduces the gain), "
    "a current, or a sponge that is too strong or begins too abruptly"
)


def _most(before: float, values: Vector) -> float:
    """Return the running maximum, without nan."""
    return float(np.fmax.reduce(values, initial=before))


@dataclass(frozen=True)
class EnergyTotals:
    """State of the energy budget.

    Attributes
    ----------
    total, wall, mass
        Energy, the wall's term W and mass at the start.
    energy, off, nothing
        Largest energy, largest error of the balance, and the energy below which values are round-off.
    lost
        Largest change of the mass.
    dissipated, earlier
        Dissipated energy, and the part of it before a change of the numerics.
    balance, jumped
        Last balance, and the sum of its jumps at changes of the numerics.
    most, given
        For each sink: the largest dissipation; the largest gain after it, and its time [s].
    supplied, damped
        Energy supplied by paddles without feedback, and dissipated by the sponge.
    """

    total: float = 0.0
    wall: float = 0.0
    mass: float = 0.0
    energy: float = 0.0
    off: float = 0.0
    nothing: float = 0.0
    lost: float = 0.0
    dissipated: float = 0.0
    earlier: float = 0.0
    balance: float = 0.0
    jumped: float = 0.0
    most: dict[str, float] = field(default_factory=dict)
    given: dict[str, tuple[float, float]] = field(default_factory=dict)
    supplied: Integral = field(default_factory=Integral)
    damped: Integral = field(default_factory=Integral)


class EnergyBudget:
    """Kinetic, potential and total energy, paddle work, dissipation, balance and mass; see ``ENERGY``.

    Parameters
    ----------
    record
        Table of the rows, in the order of ``energy_columns``.
    every
        Number of steps between rows; integrals and errors use all steps.
    sinks
        Filters that dissipate, in the order of ``Block.dissipated``.
    """

    def __init__(
        self,
        waves: Waves,
        *,
        record: Record,
        every: int = 1,
        sinks: Sequence[Smoothing] = (),
    ):
        self.schedule, self._every = EverySteps(), every
        self._waves, self._record = waves, record
        self._sinks = {type(sink).__name__: sink for sink in sinks}
        of_sinks = {name: (one.called, one.gives, one.cure) for name, one in self._sinks.items()}
        self._called = {SPONGE: (SPONGE, GAIN_CAUSES, "")} | of_sinks
        self.cause = ""  # cause of an error of the balance, and its remedy, if another part of the run has detected it
        self.state = EnergyTotals()
        self._renewed = False  # whether the numerics have changed since the last block

    def record(self, block: Block) -> None:
        """Update the balance, and append the rows that are due."""
        t, first, state = block.t, int(block.step[0]), self.state
        kinetic, potential, wall, mass = block.kinetic, block.potential, block.wall_energy, block.mass
        if first == 0:
            nothing = ROUNDING * self._waves.gravity * self._waves.depth * float(mass[0])
            start = float(kinetic[0] + potential[0])
            state = replace(state, total=start, wall=float(wall[0]), mass=float(mass[0]), nothing=nothing)
        put_in, absorbed = block.work.T
        has_feedback = not np.isnan(put_in[0])
        supplied, by_power = state.supplied.advance(t, block.power)
        damped, by_sponge = state.damped.advance(t, block.damped)
        by_sinks = zip(self._sinks, block.dissipated.T, strict=False)  # without sinks there is no dissipation
        losses = {SPONGE: by_sponge} | dict(by_sinks)
        total = kinetic + potential
        work = (put_in if has_feedback else by_power) - (wall - state.wall)
        dissipated = state.earlier + np.sum([*losses.values()], axis=0)
        balance = total - state.total - work + dissipated
        energy, due = total + dissipated, slice(-first % self._every, None, self._every)
        values = {"t": t, "kinetic": kinetic, "potential": potential, "total": total, "paddle_work": work}
        values |= {"dissipated": dissipated, "balance": balance, "mass": mass}
        if has_feedback:
            values["absorbed"], energy = absorbed, energy + np.fmax(absorbed, 0.0)
        jumped = abs(float(balance[0]) - state.balance) if self._renewed else 0.0
        most, given = _largest_losses(state, t, losses)
        self._renewed = False
        self.state = replace(
            state,
            energy=_most(state.energy, energy),
            off=_most(state.off, np.abs(balance)),
            lost=_most(state.lost, np.abs(mass[due] - state.mass)),
            dissipated=float(dissipated[-1]),
            balance=float(balance[-1]),
            jumped=state.jumped + jumped,
            most=most,
            given=given,
            supplied=supplied,
            damped=damped,
        )
        self._record.extend(energy_rows(values)[due])

    def change_numerics(self, before: EnergyTotals, *, renewed: bool) -> None:
        """Continue the totals of a run; with ``renewed`` numerics the energy of its surface may differ."""
        earlier = before.dissipated - before.damped.value - sum(sink.energy_taken for sink in self._sinks.values())
        self.state, self._renewed = replace(before, earlier=earlier, most={}), renewed

    @property
    def mass_error(self) -> float:
        """Largest relative change of the mass."""
        return self.state.lost / self.state.mass if self.state.mass else 0.0

    @property
    def energy_error(self) -> float:
        """Largest error of the balance, relative to the largest energy; 0 for still water.

        This energy includes the dissipated or absorbed part, which grows while waves pass the tank.
        """
        return self.state.off / self.state.energy if self.state.energy > self.state.nothing else 0.0

    def warnings(self) -> list[RunWarning]:
        """Return warnings of an error of the balance beyond ``BALANCE_LIMIT`` of the energy, and of its causes.

        Causes are dissipating parts that have gained more than ``GAIN_LIMIT``, and numerics that have dissipated
        more than ``LOSS_LIMIT``. The warning of the balance is the first, unless it refers to a cause before it.
        """
        state, result, most, giver = self.state, list[RunWarning](), 0.0, ""
        for name, (part, meaning, cure) in self._called.items():
            given, t = state.given.get(name, (0.0, 0.0))
            if given > max(GAIN_LIMIT * state.energy, state.nothing):
                details = {"part": part, "meaning": meaning}
                result.append(RunWarning("energy-gained", "", given / state.energy, GAIN_LIMIT, t, details=details))
                most, giver = max((most, giver), (given, part))
            if cure and (loss := state.most.get(name, 0.0)) > max(LOSS_LIMIT * state.energy, state.nothing):
                details = {"part": part, "cure": cure}
                result.append(RunWarning("energy-lost", value=loss / state.energy, limit=LOSS_LIMIT, details=details))
        if state.off > (least := max(BALANCE_LIMIT * state.energy, state.nothing)):
            reason, number = self.cause or "a shorter step or a tighter tolerance is needed", 0
            if state.off - state.jumped <= least:
                reason = "the change of numerics of the resumed run changed the energy of its surface"
            elif most > CAUSE_PART * state.off:
                reason, number = f"remove first the gain by {giver}", len(result)
            off = RunWarning(
                "energy-balance", value=state.off / state.energy, limit=BALANCE_LIMIT, details={"reason": reason}
            )
            result.insert(number, off)
        return result


def _largest_losses(
    state: EnergyTotals, t: Vector, of_all: Mapping[str, Vector]
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Return the largest loss by each sink, and the largest gain after it, with its time [s]."""
    most, given = {**state.most}, {**state.given}
    for name, loss in of_all.items():
        highest = np.fmax(np.fmax.accumulate(loss), most.get(name, loss[0]))
        back = np.fmax(highest - loss, 0.0)
        worst, most[name] = int(np.argmax(back)), float(highest[-1])
        if back[worst] > given.get(name, (0.0, 0.0))[0]:
            given[name] = float(back[worst]), float(t[worst])
    return most, given
