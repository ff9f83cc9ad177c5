"""The walls of linear waves: they stay at x = 0, and what a paddle displaces flows through them."""

import numpy as np
import ufl

from wavetank.base.arrays import Vector
from wavetank.fem.plane import Plane
from wavetank.motion import Motion
from wavetank.motion.kinematics import PaddleKinematics
from wavetank.tank.energy import Part
from wavetank.tank.walls.shape import UPRIGHT, Shape
from wavetank.tank.walls.side import Side
from wavetank.tank.walls.still import StillWall


class LinearPaddle(StillWall):
    """A paddle of small stroke.

    Parameters
    ----------
    motion
        X_p(t) with its exact derivatives.
    side
        Where the wall is.
    shape
        f(z); by default it is vertical.
    """

    largest_stroke = np.inf
    part = Part("wall", "Ẋ_p d ∫ f φ dζ at the paddle")
    description = "x = X, F = J = 1: linear waves leave the wall where it is"

    def __init__(self, motion: Motion, *, plane: Plane, side: Side, shape: Shape = UPRIGHT):
        self.motion, self.side, self.shape = motion, side, shape
        self.kinematics = PaddleKinematics(motion)
        self.opening = ufl.ds(domain=plane.mesh, subdomain_data=side.facets)(1)
        self.paddles = (self,)

    def distances(self, plane: Plane) -> Vector:
        """Return how far the degrees of freedom are from the paddle at rest [m], shape (owned,)."""
        return self.side.distances(plane.places)
