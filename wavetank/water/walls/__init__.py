"""The walls: their mapping, their part of the Hamiltonian, their places. A kind is a file: ``contract``."""

from wavetank.water.walls.both import BothEnds, LinearEnds
from wavetank.water.walls.contract import LinearWall, Placed, Wall, one_time
from wavetank.water.walls.linear import LinearPaddle
from wavetank.water.walls.piston import Piston
from wavetank.water.walls.shape import Polynomial
from wavetank.water.walls.shaped import Shaped
from wavetank.water.walls.side import Side
from wavetank.water.walls.still import StillWall
