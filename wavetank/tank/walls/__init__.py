"""The walls of a tank: their mappings, their part of the Hamiltonian, their positions."""

from wavetank.tank.walls.paddle import LinearPaddle, Paddle
from wavetank.tank.walls.shape import Polynomial
from wavetank.tank.walls.side import Side
from wavetank.tank.walls.wall import BothEnds, Wall
