"""Mappings of the reference tank to the laboratory (ours: docs/method.md, sections 1 and 7).

    x = X + a f(z) s(X) X_p(y, t),   J = 1 + f a . grad(s X_p),   mesh velocity = a f s X_p'

with the paddle's unit normal a into the water, its shape f (``shape.py``; of a vertical wall f = 1), s falling smoothly
from 1 at the paddle's rest position to 0 at the mapping's reach (motions/mapping.py), and y along the paddle. At a
height z its matrix is F = 1 + f a (x) grad(s X_p), so that a potential u has in physical space the gradient

    F^-T grad u = grad u - f grad(s X_p) (a . grad u) / J,     u_z - f' s X_p (a . grad u) / J  upwards.
"""

from dataclasses import dataclass
from typing import Any

import ufl

from wavetank.water.walls.shape import Shape


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
    """The mapping x = X + a f(z) s X_p, in UFL.

    Attributes
    ----------
    axis
        a.
    length
        s X_p [m].
    shape
        f.
    """

    axis: Any
    length: Any
    shape: Shape

    @property
    def stretching(self) -> Any:
        """A . grad(s X_p), what a paddle with f = 1 would widen elements by."""
        return ufl.inner(self.axis, ufl.grad(self.length))

    def J(self, z: Any) -> Any:
        """Return 1 + f a . grad(s X_p)."""
        return 1 + self.shape.share(z) * self.stretching

    def flow(self, slope: Any, rise: Any, *, h: Any, z: Any) -> tuple[Any, Any]:
        """Return F^-T slope, and the rise less what points at other heights are carried aside."""
        along = ufl.inner(self.axis, slope) / self.J(z)
        aside = h * self.shape.slope(z) * self.length * along
        return self._physical(slope, self.shape.share(z) * ufl.grad(self.length), self.J(z)), rise - aside

    def gradient(self, f: Any, z: Any) -> Any:
        """Return the gradient along the surface; in one dimension that is f_X / x_X."""
        carried = ufl.grad(self.shape.share(z) * self.length)
        return self._physical(ufl.grad(f), carried, 1 + ufl.inner(self.axis, carried))

    def moment(self, eta: Any, d: Any) -> Any:
        """Return 1/2 eta^2, wider by the mean of f."""
        return 0.5 * (1 + self.shape.mean(eta) * self.stretching) * eta**2

    def _physical(self, slope: Any, carried: Any, J: Any) -> Any:
        if self.axis.ufl_shape == (1,):
            return slope / J
        return slope - carried * ufl.inner(self.axis, slope) / J
