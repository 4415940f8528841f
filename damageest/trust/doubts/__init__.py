"""The doubts: one file each, with measure, thresholds and their source, criterion, words and remedy.

The table is what lies here: `list_rules` finds the class of each file. What several doubts measure is in the rooms
beside this one.
"""

from __future__ import annotations

from damageest.trust.doubt import Rule
from damageest.trust.table import find_classes


def list_rules() -> list[type[Rule]]:
    """Every rule of damageest, in the order in which reasons of equal effect are listed."""
    return sorted(find_classes(__name__, __path__, Rule), key=lambda rule: rule.rank)  # type: ignore[type-abstract]
