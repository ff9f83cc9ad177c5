"""The wall at x = 0: its mapping, its part of the Hamiltonian, its places. A kind is a file: ``contract``."""

from wavetank.water.walls.contract import LinearWall, Placed, Wall, WallTerms, one_time
from wavetank.water.walls.linear import LinearPiston
from wavetank.water.walls.piston import Piston
from wavetank.water.walls.side import Side
from wavetank.water.walls.still import StillWall

__all__ = ["LinearPiston", "LinearWall", "Piston", "Placed", "Side", "StillWall", "Wall", "WallTerms", "one_time"]
