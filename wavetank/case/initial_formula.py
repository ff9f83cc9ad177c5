"""An initial surface by formula."""

from typing import Literal

from pydantic import Field

from wavetank.case.formulae import FormulaNoun, FormulaText
from wavetank.case.tanks import AnyTank
from wavetank.values.formula import Array


class FormulaSurface(FormulaNoun):
    """eta(x, y) and psi(x, y) as given; released from rest where psi is left out."""

    type: Literal["formula"] = "formula"
    eta: FormulaText = Field(description="elevation eta(x, y) [m]")
    psi: FormulaText = Field(default="0", description="surface potential psi(x, y) [m^2/s]")

    def surface(self, tank: AnyTank, x: Array, y: Array) -> tuple[Array, Array]:
        """Return eta [m] and psi [m²/s] at places x, y [m], each of shape (N,); raises ``InputError`` if not finite."""
        return self.formula(self.eta)(x, y), self.formula(self.psi)(x, y)
