"""Waves in a ring expanded to first, second and third order of their steepness, as an initial-value problem.

With eta = eta_1 + eta_2 + eta_3 and psi = psi_1 + psi_2 + psi_3, each of its order in the amplitude,

    eta_t = G psi,  psi_t = -g eta - 1/2 psi_x² + 1/2 (G psi + eta_x psi_x)² / (1 + eta_x²)

are linear waves of each order, forced by the lower orders:

    eta_n,t = G_0 psi_n + F_n,    psi_n,t = -g eta_n + R_n,
    F_2 = G_1 psi_1,    R_2 = (w_1² - psi_1,x²) / 2,    w_1 = G_0 psi_1,    w_2 = G_0 psi_2 + F_2 + eta_1,x psi_1,x,
    F_3 = G_1 psi_2 + G_1' psi_1 + G_2 psi_1,    R_3 = w_1 w_2 - psi_1,x psi_2,x,

G_1 with eta_1 and G_1' with eta_2 (``examples/paper/dirichlet_neumann.py``). The expansion contains bound and free
waves of second and third order, at sums and differences of any number of components. A change of frequency, of third
order, appears as the beginning of its series in time: the expansion is valid while (k a)² omega t is small.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import solve_ivp

from examples.paper.dirichlet_neumann import DirichletNeumann
from wavetank.waves.airy import Array

ORDERS = 3
RTOL = 1e-10  # relative error of the integration in time


@dataclass(frozen=True, eq=False, kw_only=True)
class ExpandedWaves:
    """Waves that begin with eta_1 and psi_1 alone.

    Attributes
    ----------
    eta, psi
        The start [m] and [m²/s] at equally spaced places around the ring, shape (N,): N at least six times its waves'
        largest number around the ring.
    length, depth, gravity
        The ring's length [m], its still-water depth [m] or ``inf``, and gravity [m/s²].
    """

    eta: Array
    psi: Array
    length: float
    depth: float
    gravity: float = 9.81

    def orders(self, t: float) -> Array:
        """Return eta_1, eta_2 and eta_3 [m] at the places at a time [s], shape (3, N).

        Of a start c times as high they are c, c² and c³ times these.
        """
        start = np.zeros((2, ORDERS, self.eta.size))
        start[:, 0] = self.eta, self.psi
        end = solve_ivp(self._rate, (0.0, t), start.ravel(), method="DOP853", t_eval=[t], rtol=RTOL, atol=RTOL * 1e-3)
        return np.asarray(end.y.reshape(start.shape)[0])

    @cached_property
    def _water(self) -> DirichletNeumann:
        return DirichletNeumann((2 * np.pi * np.fft.fftfreq(self.eta.size, self.length / self.eta.size),), self.depth)

    def _rate(self, t: float, state: Array) -> Array:
        water = self._water
        (eta_1, eta_2, eta_3), (psi_1, psi_2, psi_3) = state.reshape(2, ORDERS, -1)
        slope_1, slope_2 = water.slopes(psi_1)[0], water.slopes(psi_2)[0]
        w_1, F_2 = water.G_0(psi_1), water.G_1(eta_1, psi_1)
        rise_2 = water.G_0(psi_2) + F_2
        w_2 = rise_2 + water.slopes(eta_1)[0] * slope_1
        rise_3 = water.G_0(psi_3) + water.G_1(eta_1, psi_2) + water.G_1(eta_2, psi_1) + water.G_2(eta_1, psi_1)
        R_2, R_3 = 0.5 * (w_1**2 - slope_1**2), w_1 * w_2 - slope_1 * slope_2
        g = self.gravity
        rates = (w_1, rise_2, rise_3, -g * eta_1, R_2 - g * eta_2, R_3 - g * eta_3)
        return np.concatenate(rates)
