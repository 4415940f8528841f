"""What result.json says of a reason."""

from __future__ import annotations

from pydantic import Field

from damageest.artefacts import Effect, Vector
from damageest.output.base import JsonModel


class ReasonReport(JsonModel):
    code: str = Field(description="a word that stays the same from version to version; the documentation lists them")
    effect: Effect = Field(
        description="contradicts: the site is doubtful; open: something could not be seen, without an amount the upper "
        "end of the interval is open; widens: a term of the interval; note: changes no verdict"
    )
    amount: float | None = Field(description="size of the finding; null: none")
    unit: str = Field(description="unit of the amount; empty for a share or a number")
    place: Vector | None = Field(description="where, in the part's frame; null where it has no place")
    text: str = Field(description="the finding in a sentence; the wording may change from version to version")
    remedy: str = Field(description="what to do; empty where nothing helps")
