"""What a step costs by: the kind of waves, and the entries of the operator."""

from wavetank.case import Physics, Scene
from wavetank.case.wall import HingedWall, ShapedWall
from wavetank.values.noun import Noun

# paddles, over a piston: flaps hinged at the bed or below it; other shapes, of one or both walls
DEARER = {"leaning": 1.3, "bent": 1.5, "both bent": 2.1}


def kind_of(scene: Scene, physics: Physics) -> str:
    """Return the kind of waves by what a step costs: "linear", "nonlinear", or of "driven" ones a ``DEARER`` one.

    A second paddle costs nothing but where both are bent.
    """
    kinds = [_of_paddle(seen.wall) for seen in scene.paddles]
    if physics == "linear" or not kinds:
        return physics
    return "both bent" if kinds == ["bent", "bent"] else max(kinds, key=lambda kind: DEARER.get(kind, 1.0))


def _of_paddle(wall: Noun) -> str:
    if isinstance(wall, ShapedWall):
        return "leaning" if isinstance(wall, HingedWall) and wall.hinge <= 0.0 else "bent"
    return "driven"


def undearer(kind: str) -> tuple[str, float]:
    """Return the kind that costs are fitted of, and what this one costs over it."""
    return ("driven", DEARER[kind]) if kind in DEARER else (kind, 1.0)


def entries_of(order: int, cells: int, vertical_order: int) -> int:
    """Return E, how many entries the operator of a slice or ring has."""
    return (order * cells + 1) * (vertical_order + 1) * (order + 2)
