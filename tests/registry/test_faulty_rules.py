"""Rules of plugins that fail: each is named with its package, the site is doubtful, and the run goes on."""

from __future__ import annotations

import pytest

from damageest.artefacts import Evidence
from damageest.cli._trials import try_plugins
from damageest.registry import Registry
from damageest.rules import ScanFacts, SiteFacts
from damageest.trust.verdict import apply_rules, decide
from tests.registry.test_registry import Site, site

__all__ = ["site"]
RULE = """
from damageest.artefacts import Reason
from damageest.rules import Rule

class Age(Rule):
    code = CODE
    meaning = "the part is old"
    threshold = "always"

    def find_reasons(self, site, scan):
        BODY

@hookimpl
def damageest_rules():
    return [Age]
"""
FACTS = SiteFacts(100.0, 40.0, 120.0, 200, 1.0, 2.0, Evidence(), (98.0, 102.0)), ScanFacts(0.2, 0.3, "mm")


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return [Reason(self.code, 'is old', 'note')]", ""),
        ("return site.hours / 2", "failed: AttributeError"),
        ("return None", "failed: TypeError"),
        ("import sys; sys.exit(1)", "failed: SystemExit: 1"),
        ("return ['is old']", "gave a str, and has to give Reasons"),
        ("return [Reason('below_noise', 'is old')]", "gave a reason with the code 'below_noise', not its own"),
        ("return [Reason(self.code, 'is old', 'deadly')]", "with an effect that is none of contradicts, open"),
    ],
)
def test_a_faulty_rule_makes_the_site_doubtful_and_is_named(site: Site, body: str, message: str) -> None:
    site.add("acme-age", RULE.replace("CODE", "'acme_age'").replace("BODY", body))
    registry = Registry.discover()
    reasons = apply_rules(registry.rules, *FACTS)
    level = decide(100.0, (98.0, 102.0), reasons).level
    if not message:
        assert (level, [one.code for one in reasons]) == ("proven", ["acme_age"])
        assert try_plugins(registry)[1] == []
        return
    assert level == "doubtful"
    text = reasons[0].text
    assert text.startswith("a check could not be made: the rule Age ('acme_age') of acme-age 1.2 ")
    assert message in text
    assert [fault for fault in try_plugins(registry)[1] if message in fault], "doctor says it without a run"


@pytest.mark.parametrize("code", ["pose_free", "below_noise", "align", "export", "rule_failed", "not_visible"])
def test_no_stranger_takes_a_code_that_damageest_gives(site: Site, code: str) -> None:
    site.add("acme-age", RULE.replace("CODE", repr(code)).replace("BODY", "return []"))
    (broken,) = [one for one in Registry.discover().broken if one.provider.name == "acme-age"]
    assert f"its rule Age has the code '{code}', which " in broken.reason
