"""Nouns that hold formulae of x and y, refused where they stand if they do not parse."""

from typing import Annotated

from pydantic import AfterValidator, Field, ValidationInfo

from wavetank.errors import InputError
from wavetank.values.formula import Formula, Helper
from wavetank.values.noun import Noun


def _parses(text: str, info: ValidationInfo) -> str:
    """Return a formula's text if it parses with its helpers; helpers that do not have an error of their own."""
    if "where" in info.data:
        _parse(text, info.data["where"])
    return text


def _parse_alone(where: dict[str, Helper]) -> dict[str, Helper]:
    _parse("0", where)
    return where


def _parse(text: str, where: dict[str, Helper]) -> None:
    try:
        Formula(text, where=where)
    except InputError as error:
        raise ValueError(str(error).removesuffix(".")) from None


FormulaText = Annotated[str, Field(min_length=1), AfterValidator(_parses)]


class FormulaNoun(Noun):
    """A noun whose ``FormulaText`` fields share named parts: these stand first, for a field is checked with them."""

    where: Annotated[dict[str, Helper], AfterValidator(_parse_alone)] = Field(
        default={}, description="parts of the formula by name, numbers or formulae; default: none"
    )

    def formula(self, text: str) -> Formula:
        """Return a field's formula of x and y [m]."""
        return Formula(text, where=self.where)
