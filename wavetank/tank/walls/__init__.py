"""The walls: their mapping, their part of the Hamiltonian, their places. A kind is a file: ``contract``."""

from wavetank.tank.walls.both import BothEnds, LinearEnds
from wavetank.tank.walls.contract import Wall
from wavetank.tank.walls.linear import LinearPaddle
from wavetank.tank.walls.piston import Piston
from wavetank.tank.walls.shape import Polynomial
from wavetank.tank.walls.shaped import Shaped
from wavetank.tank.walls.side import Side
from wavetank.tank.walls.still import StillWall
