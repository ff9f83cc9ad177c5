"""A watch on the step: the largest frequency the mesh carries, Doppler-shifted by the current under a steep crest.

On still water it is known before the run. Under a crest a cheap estimate, u_max k_g + (g k_g tanh(k_g d))^(1/2) with
k_g = pi p / l, 20 % off at most where it was compared, decides whether the flow linearised about the surface is asked,
which is right to a percent and costs as much as four steps.
"""

from collections.abc import Callable

from wavetank.observers.contract import Moment
from wavetank.observers.schedule import EverySteps
from wavetank.water.edge_penalty import shortest_wave_frequency, shortest_wave_number
from wavetank.water.linearised import LinearisedFlow
from wavetank.water.surface_flow import SurfaceVelocity
from wavetank.water.waves import NonlinearWaves

SUSPICIOUS = 0.8  # of the limit, in the cheap estimate
DANGEROUS = 0.95  # of the limit, by the linearised flow: measured, 0.93 ran for 80 periods and 0.98 broke down after 8
PAUSE = 50  # steps between two looks at the linearised flow


class StabilityWatch:
    """Warns, once, before a step gets too large for the waves.

    Parameters
    ----------
    waves
        The water.
    flow
        Its surface.
    cell_size
        l [m].
    dt
        Step [s].
    limit
        The scheme's, of omega dt.
    warn
        Takes the sentence.

    Attributes
    ----------
    largest
        Of dt omega_max so far, as far as it has been looked at [-].
    """

    def __init__(
        self,
        waves: NonlinearWaves,
        flow: SurfaceVelocity,
        *,
        cell_size: float,
        dt: float,
        limit: float,
        warn: Callable[[str], None],
    ):
        self.schedule = EverySteps()
        self._waves, self._flow, self._dt, self._limit, self._warn = waves, flow, dt, limit, warn
        self._k = shortest_wave_number(waves, cell_size)
        self._intrinsic = shortest_wave_frequency(waves, cell_size)
        self.largest = dt * waves.largest_frequency
        self._next = 0

    def observe(self, moment: Moment) -> None:
        """Look at the surface; collective."""
        self._flow.update(moment.q, moment.p, moment.t)
        estimate = self._dt * (self._flow.largest_velocity * self._k + self._intrinsic)
        if moment.step < self._next or estimate < SUSPICIOUS * self._limit:
            return
        self._next = moment.step + PAUSE
        found = self._dt * LinearisedFlow(self._waves, moment.q, moment.p, moment.t).spectral_radius()
        if found > DANGEROUS * self._limit >= self.largest:
            step = 0.8 * self._limit / found * self._dt
            self._warn(
                f"t = {moment.t:.6g} s: under the steepest crest dt omega_max = {found:.3g}, for a scheme "
                f"stable below {self._limit:.4g}: short waves may soon grow; a step of {step:.2g} s would do"
            )
        self.largest = max(self.largest, found)
