"""The terms of the interval: one file a source of uncertainty, with its measure, words and remedy.

The table is what lies here: `list_terms` finds the classes of each file.
"""

from __future__ import annotations

from damageest.trust.interval.site_error import Term
from damageest.trust.table import find_classes


def list_terms() -> list[type[Term]]:
    """Every term of damageest, in the order of the rows of a budget."""
    return sorted(find_classes(__name__, __path__, Term), key=lambda term: term.rank)  # type: ignore[type-abstract]
