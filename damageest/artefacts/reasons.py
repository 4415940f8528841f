"""A finding about a site or a run: data for programs, and a text for people."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Literal

from damageest.artefacts.arrays import Vector
from damageest.errors import clean_message

Effect = Literal["contradicts", "open", "widens", "note"]
"""What a reason does to a verdict, see `Reason`."""

# A line of a job, and a command of a terminal: both are written as they are.
_LITERAL = re.compile(r"\w+:|(pip|uv|damageest|python) ")


@dataclass(frozen=True)
class Reason:
    """One finding. No code reads ``text``."""

    code: Annotated[str, "a word that stays the same from version to version; the documentation lists them"]
    text: Annotated[str, "the finding in a sentence; the wording may change from version to version"]
    effect: Annotated[
        Effect,
        "contradicts: the site is doubtful; open: something could not be seen, without an amount the upper "
        "end of the interval is open; widens: a term of the interval; note: changes no verdict",
    ] = "note"
    amount: Annotated[float | None, "size of the finding; null: none"] = None
    unit: Annotated[str, "unit of the amount; empty for a share or a number"] = ""
    place: Annotated[Vector | None, "where, in the part's frame; null where it has no place"] = None
    remedy: Annotated[str, "what to do; empty where nothing helps"] = ""

    def __post_init__(self) -> None:
        """Cuts and cleans the texts: those of plugins may be of any length, with any characters."""
        object.__setattr__(self, "text", clean_message(self.text))
        object.__setattr__(self, "remedy", clean_message(self.remedy))

    def __str__(self) -> str:
        """The text, and the remedy as a sentence of its own."""
        if not self.remedy:
            return self.text
        is_literal = _LITERAL.match(self.remedy)
        return f"{self.text}. {self.remedy if is_literal else self.remedy[0].upper() + self.remedy[1:]}"
