"""Each rule on facts with a known answer, and the verdict that follows. No test reads the words of a reason."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from damageest.artefacts import Evidence, Reason
from damageest.findings import Fading, Uncertainty
from damageest.registry import Registry
from damageest.rules import FreePose, Rule, ScanFacts, SiteFacts
from damageest.trust.verdict import apply_rules, apply_to_sites, decide, open_end

CASES: dict[str, list[dict[str, Any]]] = YAML(typ="safe").load((Path(__file__).parent / "cases.yaml").read_text())
VOLUME = 20.0
SCAN = ScanFacts(tolerance=0.2, spacing=0.3, unit="mm", noise=0.05, seen_area=5000.0)
SITE = SiteFacts(
    volume=VOLUME, area=40.0, damage_area=100.0, count=500, typical=1.0, deepest=1.0, evidence=Evidence(),
    interval=(19.5, 20.5), uncertainty=Uncertainty((19.5, 20.5), (0.9, 1.1), noise=0.1),
)  # fmt: skip
RULES = {rule.code: rule for rule in Registry.discover().rules}


def make_facts(case: dict[str, Any]) -> tuple[SiteFacts, ScanFacts]:
    site: dict[str, Any] = {
        name: tuple(map(tuple, value)) if name == "covered" else tuple(value) if isinstance(value, list) else value
        for name, value in case.get("site", {}).items()
    }
    evidence = dict(case.get("evidence", {}))
    evidence["causes"] = tuple(evidence.get("causes", ()))
    site["evidence"] = Evidence(**evidence)
    if "free" in case:
        site["free"] = (FreePose("a shift", **case["free"]),)
    more = dict(case.get("uncertainty", {}))
    if "fading" in case:
        more["fading"] = Fading(**case["fading"])
    assert SITE.uncertainty is not None
    site["uncertainty"] = replace(SITE.uncertainty, **more)
    scan: dict[str, Any] = dict(case.get("scan", {}))
    if "pose" in case:
        scan["pose"] = (Reason(case["pose"], "as align says", "contradicts", case.get("amount")),)
    return replace(SITE, **site), replace(SCAN, **scan)


@pytest.mark.parametrize(
    ("code", "case"), [pytest.param(code, one, id=f"{code}: {one['name']}") for code in CASES for one in CASES[code]]
)
def test_a_rule_gives_its_reason_and_no_other_rule_objects(code: str, case: dict[str, Any]) -> None:
    site, scan = make_facts(case)
    found = tuple(RULES[code].find_reasons(site, scan))
    assert [reason.effect for reason in found] == ([] if case["effect"] is None else [case["effect"]])
    for reason in found:
        assert reason.text
        assert (reason.effect == "open" and reason.amount is None) == case.get("open_end", False)
    assert site.uncertainty is not None
    level = decide(site.volume, open_end(site.interval, found), found, site.uncertainty.certain).level
    expected = {None: "proven", "note": "proven", "widens": "proven", "open": "likely", "contradicts": "doubtful"}[
        case["effect"]
    ]
    assert level == case.get("level", expected)


def test_each_rule_has_cases_and_says_what_it_means() -> None:
    assert set(RULES) == set(CASES)
    for rule in RULES.values():
        assert rule.meaning
        assert rule.threshold
        assert any(case["effect"] for case in CASES[rule.code])
        assert any(case["effect"] is None for case in CASES[rule.code])


@pytest.mark.parametrize(
    ("volume", "number", "level"), [(20.0, 4, "doubtful"), (20.0, 3, "proven"), (1e3, 4, "proven")]
)
def test_a_small_site_is_doubted_where_nearly_all_that_was_found_is(volume: float, number: int, level: str) -> None:
    """A large one beside small contradicted ones is not, and what is contradicted has no second reason."""
    off = replace(
        SITE, volume=200.0, interval=(196.0, 204.0), evidence=Evidence(causes=("residual",), ids_residual=0.5)
    )
    own = replace(SITE, volume=volume, interval=(0.98 * volume, 1.02 * volume))
    *others, reasons = apply_to_sites(list(RULES.values()), [off] * number + [own], SCAN)
    assert decide(own.volume, own.interval, reasons).level == level
    assert [[reason.code for reason in one] for one in others] == [["off_boundary"]] * number


def test_a_plain_site_is_proven_without_reasons() -> None:
    reasons = apply_rules(RULES.values(), SITE, SCAN)
    assert reasons == ()
    assert decide(VOLUME, SITE.interval, reasons).level == "proven"


@pytest.mark.parametrize(
    ("interval", "level"),
    [
        ((19.5, 20.5), "proven"),
        ((15.0, 25.0), "likely"),
        ((4.5, 60.0), "likely"),
        ((3.9, 40.0), "doubtful"),
        ((19.5, math.inf), "likely"),
        (None, "doubtful"),
    ],
)
def test_the_level_follows_from_the_interval_alone(interval: tuple[float, float] | None, level: str) -> None:
    assert decide(VOLUME, interval, ()).level == level


def test_words_change_no_verdict() -> None:
    site, scan = make_facts({"site": {"displaced": [1]}})
    reasons = apply_rules(RULES.values(), site, scan)
    reworded = tuple(replace(reason, text="", remedy="") for reason in reasons)
    assert decide(VOLUME, site.interval, reworded).level == decide(VOLUME, site.interval, reasons).level == "doubtful"


def test_reasons_that_change_most_come_first() -> None:
    site, scan = make_facts({"site": {"displaced": [1], "count": 60, "rim_unseen": 0.1}})
    assert [one.effect for one in apply_rules(RULES.values(), site, scan)] == ["contradicts", "open", "widens"]


class Rust(Rule):
    code = "rust"
    meaning = "the site is rusty"
    threshold = "always"

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> list[Reason]:
        return [Reason(self.code, "it is rusty", "contradicts")]


class Plugin:
    def __init__(self, *rules: Any) -> None:
        self._rules = rules

    def damageest_rules(self) -> list[Any]:
        return list(self._rules)


def test_a_plugin_adds_a_rule_and_one_that_is_none_is_refused() -> None:
    from damageest.errors import PluginError
    from damageest.registry.loading import Provider
    from damageest.registry.registry import _read_told

    acme = Provider("acme", "1", "MIT", "acme")

    assert set(_read_told(Plugin(Rust), Rule, RULES, acme)) == {"rust"}
    for wrong in (Rust(), int, type("Twice", (Rust,), {"code": "displaced"}), type("Mute", (Rust,), {"meaning": None})):
        with pytest.raises(PluginError):
            _read_told(Plugin(wrong), Rule, RULES, acme)


def test_a_rule_by_the_former_name_of_its_method_is_read() -> None:
    def ask(self: Rule, site: SiteFacts, scan: ScanFacts) -> list[Reason]:
        return [Reason("damp", "it is damp")]

    words = {"code": "damp", "meaning": "the site is damp", "threshold": "always", "ask": ask}
    with pytest.warns(DeprecationWarning, match="find_reasons"):
        damp = type("Damp", (Rule,), words)
    assert [one.code for one in damp().find_reasons(SITE, SCAN)] == ["damp"]
