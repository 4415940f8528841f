"""A doubt is one file, as is a term of the interval: measure, words and remedy come out where those of damageest do."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

import damageest
from damageest.artefacts import Evidence
from damageest.cli import app
from damageest.cli._trials import try_plugins
from damageest.errors import StageError
from damageest.registry import Registry
from damageest.result import Result
from damageest.rules import LossCase, ScanFacts, SiteFacts
from damageest.trust.doubts import list_rules
from damageest.trust.interval.uncertainty import measure_term
from damageest.trust.terms import list_terms
from damageest.trust.verdict import apply_rules, compare_sites
from tests import damaged_box
from tests.registry.test_registry import Site, site

__all__ = ["site"]
DOUBT = """
from damageest.artefacts import Reason
from damageest.rules import Rule

class Tall(Rule):
    code = "acme_tall"
    meaning = "the site is taller than the gauge"
    threshold = "a height of 0.1 mm"
    remedy = "take the large gauge"
    topic = "doubtful"

    def measure(self, case):
        heights = case.points[:, 2]
        return {"acme_height": float(heights.max() - heights.min())}

    def compare(self, site, each, scan):
        return {"acme_rank": sum(one.measured["acme_height"] >= site.measured["acme_height"] for one in each)}

    def find_reasons(self, site, scan):
        if site.measured["acme_height"] > 0.1:
            text = f"number {site.measured['acme_rank']} by height"
            yield Reason(self.code, text, "contradicts", site.measured["acme_height"], scan.unit, remedy=self.remedy)

@hookimpl
def damageest_rules():
    return [Tall]
"""


TERM = """
from damageest.rules import Share, Term

class Coating(Term):
    name = "acme_coating"
    text = "thickness of the coating of the scan"
    type = "B"
    words = "the coating"
    remedy = "weigh the coating"

    def measure(self, case):
        return Share(0.5 * case.exposed, 0.5, source=0.5)

@hookimpl
def damageest_terms():
    return [Coating]
"""


def test_both_in_one_file_each_are_found_everywhere(site: Site, tmp_path: Path, small_result: Result) -> None:
    """The coating is half a unit thick, over all that is exposed: the interval is as wide, and names it."""
    site.add("acme-tall", DOUBT)
    site.add("acme-coating", TERM)
    result = damageest.run(damaged_box.write_small(tmp_path), registry=Registry.discover())
    (one,) = result.to_dict()["sites"]
    reasons = {reason["code"]: reason for reason in one["verdict"]["reasons"]}
    assert one["verdict"]["level"] == "doubtful"
    assert reasons["acme_tall"]["amount"] > 0.1
    assert reasons["acme_tall"]["text"] == "number 1 by height"
    rows = {row["source"]: row for row in one["uncertainty"]["budget"]["rows"]}
    coating = rows["acme_coating"]
    assert (coating["text"], coating["uncertainty"]) == ("thickness of the coating of the scan", 0.5)
    assert coating["contribution"] > 5
    assert "acme_coating" in [row["source"] for row in one["uncertainty"]["depth_budget"]["rows"]]
    low, high = small_result.sites[0].volume_95
    assert one["volume_95"][1] - one["volume_95"][0] > high - low + 2 * coating["contribution"]
    assert "(the coating)" in reasons["wide_interval"]["text"]
    assert reasons["wide_interval"]["remedy"] == "weigh the coating"
    assert result.volume_95 is not None, "a doubtful site is in the high end of the total"
    assert result.volume_95[1] > small_result.sites[0].damage.volume + 2 * coating["contribution"]


def test_both_are_explained(site: Site) -> None:
    site.add("acme-tall", DOUBT)
    site.add("acme-coating", TERM)
    call = CliRunner().invoke
    said = " ".join(call(app, ["explain", "acme_tall", "acme_coating"]).output.split())
    assert "what to do: take the large gauge" in said
    assert "given from: a height of 0.1 mm" in said
    assert "Read its reasons in the report" in said, "its topic"
    assert "acme_coating (term of the interval): thickness of the coating of the scan" in said
    assert "what to do: weigh the coating" in said
    tables = call(app, ["schema", "reasons"]).output
    assert "| `acme_tall` | the site is taller than the gauge | a height of 0.1 mm | take the large gauge |" in tables
    assert "| `acme_coating` | thickness of the coating of the scan | weigh the coating |" in tables


def test_doctor_tries_both_and_says_what_fails(site: Site) -> None:
    site.add("acme-tall", DOUBT)
    site.add("acme-coating", TERM.replace("source=0.5", "surce=0.5"))
    count, faults = try_plugins(Registry.discover())
    assert count >= 2
    own = [fault for fault in faults if "acme" in fault]
    assert [fault[: fault.index(" failed")] for fault in own] == [
        "the term Coating ('acme_coating') of acme-coating 1.2"
    ]


@pytest.mark.parametrize(
    ("body", "why"), [("1 / 0", "failed: ZeroDivisionError"), ("Share(float('nan'))", "a share that is not finite")]
)
def test_a_term_that_fails_is_named(site: Site, body: str, why: str) -> None:
    site.add("acme-coating", TERM.replace("Share(0.5 * case.exposed, 0.5, source=0.5)", body))
    (term,) = [term for term in Registry.discover().terms if term.owner]
    with pytest.raises(StageError, match=f"the term Coating .'acme_coating'. of acme-coating 1.2 .*{why}"):
        measure_term(term, LossCase(None, None, None))  # type: ignore[arg-type]


def test_a_measure_that_fails_makes_the_site_doubtful(site: Site) -> None:
    site.add("acme-tall", DOUBT)
    facts, scan = SiteFacts(100.0, 40.0, 120.0, 200, 1.0, 2.0, Evidence(), (98.0, 102.0)), ScanFacts(0.2, 0.3, "mm")
    rules = Registry.discover().rules
    (facts,) = compare_sites(rules, [facts], scan)  # nobody measured the height
    (reason,) = apply_rules(rules, facts, scan)
    assert (reason.code, reason.effect) == ("rule_failed", "contradicts")
    assert "the rule Tall ('acme_tall') of acme-tall 1.2 failed: KeyError" in reason.text


def test_every_file_of_the_room_is_a_doubt_and_each_has_its_own_rank() -> None:
    files = [path.stem for path in (Path(damageest.__file__).parent / "trust" / "doubts").glob("*.py")]
    rules = list_rules()
    assert len({term.rank for term in list_terms()}) == len(list_terms())
    assert sorted(rule.__module__.rpartition(".")[2] for rule in rules) == sorted(set(files) - {"__init__"})
    assert len({rule.rank for rule in rules}) == len(rules)
