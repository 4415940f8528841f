"""The doubts: one file each, with measure, thresholds and their source, criterion, words and remedy.

The table is what lies here: `list_rules` finds the class of each file. What several doubts measure is in the rooms
beside this one.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from damageest.trust.doubt import Rule


def list_rules() -> list[type[Rule]]:
    """Every rule of damageest, in the order in which reasons of equal effect are listed."""
    modules = [import_module(f"{__name__}.{found.name}") for found in iter_modules(__path__)]
    found = [
        one
        for module in modules
        for one in vars(module).values()
        if isinstance(one, type) and issubclass(one, Rule) and one.__module__ == module.__name__
    ]
    return sorted(found, key=lambda rule: rule.rank)
