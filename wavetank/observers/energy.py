"""The energy budget: what the water has, what the paddle has put in, and what does not add up.

The paddle's power is exact for the discrete Hamiltonian: along the flow dH/dt = dH/dt|explicit, so with E = H - W

    E(t) - E(0) = int_0^t dH/dt|explicit dt' - [W]_0^t  =  paddle work,

integrated over the recorded moments by Adams-Moulton's rule of order 4. The balance, E - E(0) - work, is then the error
of the time integrator.
"""

from wavetank.observers.contract import Moment
from wavetank.observers.record import Record
from wavetank.observers.schedule import EverySteps
from wavetank.water.waves import NonlinearWaves

COLUMNS = (
    "t [s]",
    "kinetic [m^4/s^2]",
    "potential [m^4/s^2]",
    "total [m^4/s^2]",
    "paddle_work [m^4/s^2]",
    "balance [m^4/s^2]",
    "mass [m^2]",
)

ADAMS_MOULTON = {  # weights of f at the newest, second newest, ... moment
    2: (1 / 2, 1 / 2),
    3: (5 / 12, 8 / 12, -1 / 12),
    4: (9 / 24, 19 / 24, -5 / 24, 1 / 24),
}


class EnergyBudget:
    """Kinetic, potential and total energy, paddle work, balance and mass, per unit of density and width.

    Parameters
    ----------
    record
        Where rows of ``COLUMNS`` go.
    schedule
        In steps: the work is integrated from the recorded moments.
    """

    def __init__(self, waves: NonlinearWaves, *, record: Record, schedule: EverySteps):
        self._waves, self._record, self.schedule = waves, record, schedule
        self._rates: list[float] = []
        self._supplied = self._t = 0.0

    def observe(self, moment: Moment) -> None:
        """Append one row; collective."""
        now = self._waves.energies(moment.q, moment.p, moment.t)
        rate = self._waves.explicit_rate(moment.q, moment.p, moment.t)
        self._integrate(moment.t, rate)
        if moment.step == 0:
            self._start = now
        work = self._supplied - (now.wall - self._start.wall)
        balance = now.total - self._start.total - work
        mass = self._waves.total_mass(moment.q)
        self._record.append([moment.t, now.kinetic, now.potential, now.total, work, balance, mass])

    def _integrate(self, t: float, rate: float) -> None:
        self._rates = [rate, *self._rates[:3]]
        if len(self._rates) > 1:
            weights = ADAMS_MOULTON[len(self._rates)]
            self._supplied += (t - self._t) * sum(w * f for w, f in zip(weights, self._rates, strict=True))
        self._t = t
