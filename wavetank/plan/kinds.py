"""What a step costs by: the kind of waves, and the entries of the operator."""

from wavetank.case import Physics, Scene
from wavetank.case.moving_wall import HingedWall, ShapedWall

DEARER = {"leaning": 1.3, "bent": 1.5}  # paddles, over a piston: flaps hinged at the bed or below it; other shapes


def kind_of(scene: Scene, physics: Physics) -> str:
    """Return the kind of waves by what a step costs: "linear", "nonlinear", or of "driven" ones a ``DEARER`` one."""
    wall = scene.wall
    if physics == "linear" or not wall.moves:
        return physics
    if isinstance(wall, ShapedWall):
        return "leaning" if isinstance(wall, HingedWall) and wall.hinge <= 0.0 else "bent"
    return "driven"


def undearer(kind: str) -> tuple[str, float]:
    """Return the kind that costs are fitted of, and what this one costs over it."""
    return ("driven", DEARER[kind]) if kind in DEARER else (kind, 1.0)


def entries_of(order: int, cells: int, vertical_order: int) -> int:
    """Return E, how many entries the operator of a slice or ring has."""
    return (order * cells + 1) * (vertical_order + 1) * (order + 2)
