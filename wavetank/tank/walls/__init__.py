"""The walls of a tank: their mapping, their part of the Hamiltonian, their places."""

from wavetank.tank.walls.paddle import LinearPaddle, Paddle
from wavetank.tank.walls.shape import Polynomial
from wavetank.tank.walls.side import Side
from wavetank.tank.walls.wall import BothEnds, Wall
