"""Mappings of the reference tank to the laboratory that are the same at all heights (ours: docs/method.md, section 1).

    x = X + a s(X) X_p(y, t),   J = 1 + a . grad(s X_p),   mesh velocity = a s X_p'

with the paddle's unit normal a into the water, s falling smoothly from 1 at the paddle's rest position to 0 at the
mapping's reach (motions/mapping.py), and y along the paddle. Its matrix is F = 1 + a (x) grad(s X_p), so that the
physical gradient is

    F^-T grad f = grad f - grad(s X_p) (a . grad f) / J.
"""

from dataclasses import dataclass
from typing import Any

import ufl


class Identity:
    """The mapping of a wall that stands still."""

    def J(self, z: Any) -> Any:
        """Return 1."""
        return ufl.as_ufl(1)

    def flow(self, slope: Any, rise: Any, *, h: Any, z: Any) -> tuple[Any, Any]:
        """Return slope and rise."""
        return slope, rise

    def gradient(self, f: Any, z: Any) -> Any:
        """Return the gradient in the reference tank, which is the physical one."""
        return ufl.grad(f)

    def moment(self, eta: Any, d: Any) -> Any:
        """Return 1/2 eta^2."""
        return 0.5 * eta**2


@dataclass(frozen=True)
class Shift:
    """The mapping x = X + a s X_p, in UFL.

    Attributes
    ----------
    axis
        a.
    length
        s X_p [m].
    """

    axis: Any
    length: Any

    def J(self, z: Any = None) -> Any:
        """Return 1 + a . grad(s X_p)."""
        return 1 + ufl.inner(self.axis, ufl.grad(self.length))

    def flow(self, slope: Any, rise: Any, *, h: Any, z: Any) -> tuple[Any, Any]:
        """Return F^-T slope, and the rise as it is."""
        return self._physical(slope), rise

    def gradient(self, f: Any, z: Any) -> Any:
        """Return F^-T grad f; in one dimension that is f_X / J."""
        return self._physical(ufl.grad(f))

    def moment(self, eta: Any, d: Any) -> Any:
        """Return 1/2 J eta^2."""
        return 0.5 * self.J() * eta**2

    def _physical(self, slope: Any) -> Any:
        if self.axis.ufl_shape == (1,):
            return slope / self.J()
        return slope - ufl.grad(self.length) * ufl.inner(self.axis, slope) / self.J()
