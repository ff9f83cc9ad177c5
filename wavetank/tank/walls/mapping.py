"""Mappings of the reference tank to the laboratory (ours: docs/method.md, sections 1 and 7).

    x = X + a f(z) s(X) X_p(y, t),   J = 1 + f a . grad(s X_p),   mesh velocity = a f s X_p'

with a unit vector a normal to the paddle, X_p along it, the shape f (``shape.py``; for a vertical wall f = 1), s
decreasing smoothly from 1 at the paddle's rest position to 0 at the mapping's reach (motion/motion.py), and y along the
paddle. For two paddles at opposite ends f s X_p is the sum of both, one of which is zero everywhere. At a height z the
matrix is F = 1 + f a (x) grad(s X_p), so that a potential u has in physical space the gradient

    F^-T grad u = grad u - f grad(s X_p) (a . grad u) / J,     u_z - f' s X_p (a . grad u) / J  upwards.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import ufl

from wavetank.tank.walls.shape import Polynomial


@dataclass(frozen=True)
class Shift:
    """The mapping x = X + a f(z) s X_p, in UFL; without paddles the identity.

    Attributes
    ----------
    axis
        a.
    parts
        s X_p [m] and f of each paddle.
    """

    axis: Any = None
    parts: Sequence[tuple[Any, Polynomial]] = ()

    def stretching(self, factor: Callable[[Polynomial], Any]) -> Any:
        """Return a . grad(f s X_p), the relative stretching of elements, with a given factor for each f."""
        return sum(factor(shape) * ufl.inner(self.axis, ufl.grad(length)) for length, shape in self.parts)

    def J(self, z: Any) -> Any:
        """Return 1 + f a . grad(s X_p)."""
        return ufl.as_ufl(1 + self.stretching(lambda shape: shape.value(z)))

    def flow(self, slope: Any, rise: Any, *, h: Any, z: Any) -> tuple[Any, Any]:
        """Return F^-T slope, and the rise minus the part from the displacement at other heights."""
        if not self.parts:
            return slope, rise
        along = ufl.inner(self.axis, slope) / self.J(z)
        aside = sum(h * shape.slope(z) * length * along for length, shape in self.parts)
        gradient = sum(shape.value(z) * ufl.grad(length) for length, shape in self.parts)
        return self._physical(slope, gradient, self.J(z)), rise - aside

    def gradient(self, f: Any, z: Any) -> Any:
        """Return the gradient along the surface; in one dimension f_X / x_X."""
        if not self.parts:
            return ufl.grad(f)
        gradient = sum(ufl.grad(shape.value(z) * length) for length, shape in self.parts)
        return self._physical(ufl.grad(f), gradient, 1 + ufl.inner(self.axis, gradient))

    def moment(self, eta: Any, d: Any) -> Any:
        """Return 1/2 eta^2, stretched by the mean of f."""
        return 0.5 * (1 + self.stretching(lambda shape: shape.mean(eta))) * eta**2

    def _physical(self, slope: Any, gradient: Any, J: Any) -> Any:
        if self.axis.ufl_shape == (1,):
            return slope / J
        return slope - gradient * ufl.inner(self.axis, slope) / J
