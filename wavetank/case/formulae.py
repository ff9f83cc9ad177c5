"""Nouns that hold formulae of x and y, of z, or of t, refused where they stand if they do not parse."""

from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationInfo

from wavetank.errors import InputError
from wavetank.values.formula import Formula, Helper
from wavetank.values.noun import Noun


def _parses(text: str, info: ValidationInfo, *, variables: Sequence[str]) -> str:
    """Return a formula's text if it parses with its helpers; helpers that do not have an error of their own."""
    if "where" in info.data:
        _parse(text, info.data["where"], variables)
    return text


def _parse_alone(where: dict[str, Helper], *, variables: Sequence[str]) -> dict[str, Helper]:
    _parse("0", where, variables)
    return where


def _parse(text: str, where: dict[str, Helper], variables: Sequence[str]) -> None:
    try:
        Formula(text, where=where, variables=variables)
    except InputError as error:
        raise ValueError(str(error).removesuffix(".")) from None


def _checked_by(check: Any, *variables: str) -> AfterValidator:
    return AfterValidator(partial(check, variables=variables))


FormulaText = Annotated[str, Field(min_length=1), _checked_by(_parses, "x", "y")]
TimeFormulaText = Annotated[str, Field(min_length=1), _checked_by(_parses, "t")]
HeightFormulaText = Annotated[str, Field(min_length=1), _checked_by(_parses, "z")]
HeightHelpers = Annotated[dict[str, Helper], _checked_by(_parse_alone, "z")]
TimeHelpers = Annotated[dict[str, Helper], _checked_by(_parse_alone, "t")]


class FormulaNoun(Noun):
    """A noun whose ``FormulaText`` fields share named parts: these stand first, for a field is checked with them."""

    where: Annotated[dict[str, Helper], _checked_by(_parse_alone, "x", "y")] = Field(
        default={}, description="parts of the formula by name, numbers or formulae; default: none"
    )

    def formula(self, text: str) -> Formula:
        """Return a field's formula of x and y [m]."""
        return Formula(text, where=self.where)
