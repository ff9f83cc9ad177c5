"""The energy budget: what the water has, what the paddle has put in, and what does not add up.

The paddle's power is exact for the discrete Hamiltonian: along the flow dH/dt = dH/dt|explicit, so with E = H - W

    E(t) - E(0) = int_0^t dH/dt|explicit dt' - [W]_0^t  =  paddle work,

integrated over all steps (``supply.py``), however few of them are recorded; so is what the sponge takes, gamma psi
H_psi. What is dissipated between steps its sinks count themselves. The balance, E - E(0) - work + dissipated, is then
the error of the time integrator. A scheme that reports the mean of two traces evaluates these, not the mean: power is
the mean of theirs, and H of the mean is that of the plus trace and its derivatives times what lies between
(``tank/seen.py``); both are right to the square of the jump. Where something acts between steps, these are the minus
trace before and the plus trace after.
"""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from wavetank.arrays import Vector
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.contract import Waves
from wavetank.simulation.records import Record
from wavetank.simulation.supply import Integral
from wavetank.stateful import Held
from wavetank.tank.seen import Block

ROUNDING = 1e-12  # of g d² of the whole tank: less energy is round-off
TRUE = 0.01  # of the energy, what has gone included: a balance that is farther off is told
GIVEN = 1e-3  # of the energy: of what should take, giving more than that is told
BLAMED = 0.2  # of what the balance is off: one that should take and has given more than that is why
LOST = 0.01  # of the energy, half of that of the waves' height: losing more to numerics is told

# what a budget remembers:
SUMS = (
    *("total", "wall", "mass"),
    *("energy", "off", "lost", "nothing", "dissipated", "earlier", "balance", "jumped"),
)


SPONGE = "the sponge"
GIVES = (
    "waves far longer than it, as go before a train or a group, make it do so (a longer sponge gives less), "
    "or a current, or it is too strong or begins too abruptly"
)


@runtime_checkable
class Sink(Protocol):
    """What takes energy out of the water and counts it.

    Where it is ``called`` something, that and ``gives`` say what it is that gives energy instead, and when it does;
    where that is numerics, which should take little, ``cure`` says how less is lost.
    """

    energy_taken: float


def _most(before: float, values: Vector) -> float:
    """Return the largest so far of what is a number."""
    return float(np.fmax.reduce(values, initial=before))


class EnergyBudget:
    """Kinetic, potential and total energy, paddle work, dissipation, balance and mass; see ``energy_columns``.

    Parameters
    ----------
    record
        Where rows of ``energy_columns`` go.
    every
        Steps between rows; the work is integrated from all of them, and all of them are judged.
    sinks
        What dissipates, in the order of ``Block.dissipated``.
    """

    def __init__(
        self,
        waves: Waves,
        *,
        record: Record,
        every: int = 1,
        sinks: Sequence[Sink] = (),
    ):
        self.schedule, self._every = EverySteps(), every
        self._waves, self._record, self._supplied = waves, record, Integral()
        self._sinks = {type(sink).__name__: sink for sink in sinks}
        usual = {"called": "what damps them", "gives": "it should take", "cure": ""}
        of_sinks = {name: tuple(getattr(one, *pair) for pair in usual.items()) for name, one in self._sinks.items()}
        self._called = {SPONGE: (SPONGE, GIVES, "")} | of_sinks
        self._damped = Integral()  # what the sponge takes
        self._total = self._wall = self._mass = 0.0  # at the start
        self.cause = ""  # of a balance that is off, and what helps, if another part of the run knows it
        self._energy = self._off = self._nothing = 0.0  # the largest there was of both, and what counts as none
        self._lost = 0.0  # of the mass, or won, at the most
        self._dissipated = self._earlier = 0.0  # in all, and by what took it before the numerics changed
        self._balance = self._jumped = 0.0  # the last, and what it changed by where numerics did
        self._renewed = False  # whether they have, since it was last looked at
        self._most = dict[str, float]()  # that each sink had taken
        self._given = dict[str, tuple[float, float]]()  # the most that came back of that, and until when [s]

    def record(self, block: Block) -> None:
        """Update the balance, and append the rows that are due."""
        t, first = block.t, int(block.step[0])
        kinetic, potential, wall, mass = block.kinetic, block.potential, block.wall_energy, block.mass
        supplied, absorbed = block.work.T
        if np.isnan(supplied[0]):  # no paddle has feedback
            supplied, absorbed = self._supplied.advance(t, block.power), None
        if first == 0:
            self._total, self._wall, self._mass = float(kinetic[0] + potential[0]), float(wall[0]), float(mass[0])
            self._nothing = ROUNDING * self._waves.gravity * self._waves.depth * self._mass
        rows = np.empty((8 if absorbed is None else 9, len(t)))
        total, work, dissipated, balance = rows[3:7]
        rows[0], rows[1], rows[2], rows[7] = t, kinetic, potential, mass
        total[:] = kinetic + potential
        work[:] = supplied - (wall - self._wall)
        by_sinks = zip(self._sinks, block.dissipated.T, strict=False)  # without sinks none is counted
        taken = {SPONGE: self._damped.advance(t, block.damped)} | dict(by_sinks)
        self._judge(t, taken)
        dissipated[:] = self._earlier + sum(taken.values())
        balance[:] = total - self._total - work + dissipated
        if self._renewed:
            self._jumped, self._renewed = self._jumped + abs(float(balance[0]) - self._balance), False
        self._balance = float(balance[-1])
        energy = total + dissipated
        if absorbed is not None:
            rows[8], energy = absorbed, energy + np.fmax(absorbed, 0.0)
        self._dissipated = float(dissipated[-1])
        self._energy, self._off = _most(self._energy, energy), _most(self._off, np.abs(balance))
        due = rows[:, -first % self._every :: self._every]
        self._lost = _most(self._lost, np.abs(due[7] - self._mass))
        self._record.extend(due.T)

    def _judge(self, t: Vector, of_all: dict[str, Vector]) -> None:
        """Take note of the most that each had taken, and of what it has given back of it."""
        for name, taken in of_all.items():
            most = np.fmax(np.fmax.accumulate(taken), self._most.get(name, taken[0]))
            given = np.fmax(most - taken, 0.0)
            worst, self._most[name] = int(np.argmax(given)), float(most[-1])
            if given[worst] > self._given.get(name, (0.0, 0.0))[0]:
                self._given[name] = float(given[worst]), float(t[worst])

    @property
    def _by_sinks(self) -> float:
        return sum(sink.energy_taken for sink in self._sinks.values())

    @property
    def mass_error(self) -> float:
        """The largest change of the mass in what is recorded, over the mass."""
        return self._lost / self._mass if self._mass else 0.0

    @property
    def energy_error(self) -> float:
        """The largest that the balance was off, over the largest energy, with what has gone by then; of still water 0.

        What has gone is what was dissipated or absorbed: waves may come and go for long where few are at a time.
        """
        return self._off / self._energy if self._energy > self._nothing else 0.0

    def verdict(self) -> list[str]:
        """Return a sentence if the balance was ever off by more than ``TRUE`` of the energy, and what that came by.

        And one for each that should take energy and has given back more than ``GIVEN`` of it, and for numerics that
        have taken more than ``LOST`` of it. What the balance is off by comes first, but after what it is blamed on.
        """
        sentences, most, giver = list[str](), 0.0, ""
        for name, (called, gives, cure) in self._called.items():
            given, t = self._given.get(name, (0.0, 0.0))
            if given > max(GIVEN * self._energy, self._nothing):
                part = f"has given the waves {given / self._energy:.2g} of the energy by t = {t:.4g} s"
                sentences.append(f"{called} {part}: {gives}")
                most, giver = max((most, giver), (given, called))
            if cure and (taken := self._most.get(name, 0.0)) > max(LOST * self._energy, self._nothing):
                sentences.append(f"{called} has taken {taken / self._energy:.2g} of the energy: {cure}")
        if self._off > (least := max(TRUE * self._energy, self._nothing)):
            what, place = self.cause or "a shorter step or a tighter tolerance is needed", 0
            if self._off - self._jumped <= least:
                what = "with the numerics that the run went on with its surface had another energy"
            elif most > BLAMED * self._off:
                what, place = f"see first to what {giver} has given", len(sentences)
            off = f"the energy balance is off by {self._off / self._energy:.2g} of the energy"
            sentences.insert(place, f"{off}: {what}")
        return sentences

    def held(self) -> Held:
        """Return the sums so far, and what the balance is judged by."""
        of_sinks = {"most": {**self._most}, "given": {**self._given}}
        sums = {name: getattr(self, f"_{name}") for name in SUMS}
        return sums | of_sinks | {"supply": self._supplied.held(), "damped": self._damped.held()}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        for name in SUMS:
            setattr(self, f"_{name}", held[name])
        self._supplied.take(held["supply"])
        self._damped.take(held["damped"])
        self._most, self._given = {**held["most"]}, {name: (given, t) for name, (given, t) in held["given"].items()}

    def carry(self, held: Held) -> None:
        """Take the sums; what was dissipated stays so, whatever dissipates now."""
        self.take(held)
        self._earlier, self._most = self._dissipated - self._damped.value - self._by_sinks, {}

    def renewed(self) -> None:
        """Know that the next step is the first with other numerics, which may have another energy of the surface."""
        self._renewed = True
