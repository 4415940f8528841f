"""The one criterion: what a site is worth follows from the interval of its volume and from the reasons of the rules."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from damageest.artefacts import Reason
from damageest.findings import Interval, Level, Verdict
from damageest.rules import Rule, ScanFacts, SiteFacts
from damageest.rules.nothing import NOTHING

NARROW = 0.05
"""Half-width of the interval, as a share of the volume, up to which a site is proven."""
ORDER = {"contradicts": 0, "open": 1, "widens": 2, "note": 3}


def ask_rules(rules: Iterable[Rule], site: SiteFacts, scan: ScanFacts) -> tuple[Reason, ...]:
    """The reasons of all rules, those first that change the verdict most."""
    found = [reason for rule in rules for reason in rule.ask(site, scan)]
    return tuple(sorted(dict.fromkeys(found), key=lambda reason: ORDER[reason.effect]))


def open_end(interval: Interval | None, reasons: Sequence[Reason]) -> Interval | None:
    """The interval with its high end at infinity where a reason says that nothing limits it."""
    is_open = any(reason.effect == "open" and reason.amount is None for reason in reasons)
    return (interval[0], math.inf) if interval and is_open else interval


def decide(volume: float, interval: Interval | None, reasons: tuple[Reason, ...]) -> Verdict:
    """The verdict on a damage volume.

    A cause that has a size is a term of the ``interval`` and condemns nothing by itself; a contradiction does.
    """
    return Verdict(_choose_level(volume, interval, {reason.effect for reason in reasons}), reasons)


def _choose_level(volume: float, interval: Interval | None, effects: set[str]) -> Level:
    if "contradicts" in effects or interval is None or interval[0] <= NOTHING * volume:
        return "doubtful"
    is_narrow = (interval[1] - interval[0]) / 2 <= NARROW * volume
    return "proven" if is_narrow and "open" not in effects else "likely"
