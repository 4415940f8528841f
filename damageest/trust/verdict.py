"""The one criterion: what a site is worth follows from the interval of its volume and from the reasons of the rules."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from damageest.artefacts import Reason
from damageest.errors import clean_message, is_interrupt
from damageest.findings import Interval, Level, Verdict
from damageest.isolation import at_work
from damageest.trust.doubt import RULE_FAILED, Rule, ScanFacts, SiteCase, SiteFacts
from damageest.trust.doubts.nothing import is_nothing
from damageest.trust.interval.site_error import Term

NARROW = 0.05
"""Half-width of the interval, as a share of the volume, up to which a site is proven."""
ORDER = {"contradicts": 0, "open": 1, "widens": 2, "note": 3}

T = TypeVar("T")


def measure_facts(rules: Iterable[Rule], case: SiteCase, facts: SiteFacts) -> SiteFacts:
    """The ``facts`` about a site with what each rule measures."""
    for rule in rules:
        facts = _add(facts, rule, lambda rule=rule: rule.measure(case))  # type: ignore[misc]
    return facts


def compare_sites(rules: Sequence[Rule], each: Sequence[SiteFacts], scan: ScanFacts) -> list[SiteFacts]:
    """The facts of each site with what those of the others say about it."""
    done = []
    for facts in each:
        new = facts
        for rule in rules:
            new = _add(new, rule, lambda rule=rule, facts=facts: rule.compare(facts, each, scan))  # type: ignore[misc]
        done.append(new)
    return done


def _add(facts: SiteFacts, rule: Rule, measure: Callable[[], Mapping[str, Any]]) -> SiteFacts:
    """The facts with what a rule measures. What a rule of a plugin gives has its own place, as has its failure."""
    if not rule.owner:
        found = measure()
        return replace(facts, **found) if found else facts
    given = _call_foreign(rule, lambda: dict(measure()))
    if isinstance(given, Reason):
        return replace(facts, failed={**facts.failed, rule.code: given})
    return replace(facts, measured={**facts.measured, **given}) if given else facts


def apply_rules(rules: Iterable[Rule], site: SiteFacts, scan: ScanFacts) -> tuple[Reason, ...]:
    """The reasons of all rules, those first that change the verdict most. A rule of a plugin that fails makes the site
    doubtful: what it was to find is not known."""
    found = [
        reason
        for rule in rules
        for reason in (apply_foreign_rule(rule, site, scan) if rule.owner else rule.find_reasons(site, scan))
    ]
    return tuple(sorted(dict.fromkeys(found), key=lambda reason: ORDER[reason.effect]))


def apply_to_sites(rules: Sequence[Rule], each: Sequence[SiteFacts], scan: ScanFacts) -> list[tuple[Reason, ...]]:
    """The reasons of each site. Where others are contradicted, its rules are asked again and know of them."""
    first = [apply_rules(rules, facts, scan) for facts in each]
    is_out = [any(reason.effect == "contradicts" for reason in reasons) for reasons in first]
    number, total = sum(is_out), sum(facts.volume for facts in each)
    if number in (0, len(each)) or not total:
        return first
    share = sum(facts.volume for facts, out in zip(each, is_out, strict=True) if out) / total
    return [
        reasons if out else apply_rules(rules, replace(facts, contradicted=number, contradicted_share=share), scan)
        for facts, reasons, out in zip(each, first, is_out, strict=True)
    ]


def apply_foreign_rule(rule: Rule, site: SiteFacts, scan: ScanFacts) -> list[Reason]:
    """The reasons of a rule of a plugin; where it fails, or gives what is none of its own, one that says so."""
    if rule.code in site.failed:
        return [site.failed[rule.code]]
    found = _call_foreign(rule, lambda: list(rule.find_reasons(site, scan)))
    if isinstance(found, Reason):
        return [found]
    for reason in found:
        if not isinstance(reason, Reason):
            return [_describe_failed(rule, f"gave a {type(reason).__name__}, and has to give Reasons")]
        if reason.code != rule.code:
            return [
                _describe_failed(rule, f"gave a reason with the code '{clean_message(reason.code, 80)}', not its own")
            ]
        if reason.effect not in ORDER:
            return [_describe_failed(rule, f"gave a reason with an effect that is none of {', '.join(ORDER)}")]
    return found


def _call_foreign(rule: Rule, ask: Callable[[], T]) -> T | Reason:
    """What a rule of a plugin answers; where it fails, the reason that says so."""
    try:
        with at_work(f"rule {rule.code}", owner=rule.owner):
            return ask()
    except BaseException as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        return _describe_failed(rule, f"failed: {type(error).__name__}: {clean_message(error, 400)}")


def name_told(told: Rule | Term) -> str:
    """What a rule or a term of a plugin is called in messages."""
    what, name = ("rule", told.code) if isinstance(told, Rule) else ("term", told.name)
    return f"the {what} {type(told).__qualname__} ('{name}') of {told.owner}"


def _describe_failed(rule: Rule, why: str) -> Reason:
    return Reason(
        RULE_FAILED,
        f"a check could not be made: {name_told(rule)} {why}",
        "contradicts",
        remedy=f"report it to the authors of {rule.owner}, or uninstall it",
    )


def open_end(interval: Interval | None, reasons: Sequence[Reason]) -> Interval | None:
    """The interval with its high end at infinity where a reason says that nothing limits it."""
    is_open = any(reason.effect == "open" and reason.amount is None for reason in reasons)
    return (interval[0], math.inf) if interval and is_open else interval


def decide(volume: float, interval: Interval | None, reasons: tuple[Reason, ...], certain: float = 0.0) -> Verdict:
    """The verdict on a damage volume, of which a piece of ``certain`` volume is lost in any case.

    Quantifiable errors are terms of the ``interval``; the verdict follows from its width and from contradictions.
    """
    return Verdict(_choose_level(volume, interval, {reason.effect for reason in reasons}, certain), reasons)


def _choose_level(volume: float, interval: Interval | None, effects: set[str], certain: float) -> Level:
    if "contradicts" in effects or interval is None or is_nothing(volume, interval, certain):
        return "doubtful"
    is_narrow = (interval[1] - interval[0]) / 2 <= NARROW * volume
    return "proven" if is_narrow and "open" not in effects else "likely"
