"""A finding about a site or a run: data for programs, and a text for people."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from damageest.artefacts.arrays import Vector
from damageest.errors import clean_message

Effect = Literal["contradicts", "open", "widens", "note"]
"""What a reason does to a verdict. `contradicts`: the site is doubtful. `open`: something could not be seen; without an
amount, the upper end of the interval is open. `widens`: it is a term of the interval. `note`: it changes no verdict."""

# A line of a job, and a command of a terminal: both are written as they are.
_LITERAL = re.compile(r"\w+:|(pip|uv|damageest|python) ")


@dataclass(frozen=True)
class Reason:
    """One finding. No code reads ``text``: its wording may change at any time.

    ``code``: a word that stays the same from version to version. ``amount``: its size in ``unit`` (for example "mm" or
    "mm³"; "" for a share or a number), or None. ``place`` (3,): where, in the part's frame. ``remedy``: what to do;
    empty where nothing helps.
    """

    code: str
    text: str
    effect: Effect = "note"
    amount: float | None = None
    unit: str = ""
    place: Vector | None = None
    remedy: str = ""

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
