"""The run-up of a solitary wave at a vertical wall: what a mesh misses of its peak.

The peak at the wall is narrower than the wave. With R the run-up, d the depth and h = H / d the relative wave height,
its curvature at the wall is -R / l², and

    l / d = (2 / (3 h))^(1/2) (1 - (3 h / 2)²),     R / d = 2 h + h² / 2 + 3 h³ / 4.

The first factor of l is the sech² profile's. The second is fitted to converged runs of h = 0.05 to 0.6 (within 2 %, at
0.6 6 %); it vanishes at h = 2/3, where the run-up ends in a thin jet. The relative error of R is predicted as

    e = 0.1 (dx / ((p - 1) l))⁴ + |e_n(k d = (d + R) / l)|,

e_n being the relative error of the linear frequency by the vertical order alone. The first term is fitted to p = 2 to 5
with e = 0.1 to 5 %: it is 0.7 to 2 times the measured error for h = 0.5 and 0.6, and 2 to 6 times for lower waves. The
second is 0.9 to 2 times the measured error, where that is above 0.1 % (docs/plan.md). The step needs no term: a stable
step misses less than 0.1 %.

Source: R by C. H. Su and R. M. Mirie, "On head-on collisions between two solitary waves", J. Fluid Mech. 98, 1980.
"""

from dataclasses import dataclass

import numpy as np

from wavetank.planning.dispersion import Mesh, relative_frequency_error

RESOLVED = 0.6  # H / d of the highest run-up that was computed with two meshes within 0.02 %
CELLS = 0.1  # factor of the cells' part
LINEAR = 0.3  # in the place of p - 1 for order 1


@dataclass(frozen=True)
class RunUp:
    """The run-up of a solitary wave.

    Attributes
    ----------
    height
        Wave height over depth, H / d.
    depth
        Still-water depth d [m].
    """

    height: float
    depth: float

    @property
    def resolved(self) -> bool:
        """Whether its accuracy can be predicted."""
        return self.height <= RESOLVED

    @property
    def width(self) -> float:
        """The length l of the peak [m], that of ``RESOLVED`` for higher waves."""
        h = min(self.height, RESOLVED)
        return self.depth * float(np.sqrt(2 / (3 * h))) * (1 - (1.5 * h) ** 2)

    @property
    def elevation(self) -> float:
        """The run-up R [m]."""
        h = min(self.height, RESOLVED)
        return self.depth * (2 * h + h**2 / 2 + 0.75 * h**3)

    def error(self, mesh: Mesh) -> float:
        """Return the predicted relative error of R on a mesh."""
        nodes = mesh.cells.size / max(mesh.cells.order - 1, LINEAR)
        kd = (self.depth + self.elevation) / self.width
        return CELLS * (nodes / self.width) ** 4 + abs(relative_frequency_error(kd, mesh.vertical_order))
