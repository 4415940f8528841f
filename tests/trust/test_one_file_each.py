"""A doubt is one file: its measure, threshold, words and remedy come out where those of damageest do."""

from __future__ import annotations

import json
from pathlib import Path

from typer.testing import CliRunner

import damageest
from damageest.artefacts import Evidence
from damageest.cli import app
from damageest.registry import Registry
from damageest.rules import ScanFacts, SiteFacts
from damageest.trust.doubts import list_rules
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


def test_a_doubt_in_one_file_is_found_everywhere(site: Site, tmp_path: Path) -> None:
    site.add("acme-tall", DOUBT)
    damageest.run(damaged_box.write_small(tmp_path), registry=Registry.discover(), output=True)
    (result,) = tmp_path.glob("out/*/result.json")
    (one,) = json.loads(result.read_text())["sites"]
    assert one["verdict"]["level"] == "doubtful"
    (reason,) = [reason for reason in one["verdict"]["reasons"] if reason["code"] == "acme_tall"]
    assert reason["amount"] > 0.1
    assert reason["text"] == "number 1 by height"
    call = CliRunner().invoke
    said = call(app, ["explain", "acme_tall"]).output
    assert "what to do: take the large gauge" in said
    assert "given from: a height of 0.1 mm" in said
    assert "Read its reasons in the report" in " ".join(said.split()), "its topic"
    assert (
        "| `acme_tall` | the site is taller than the gauge | a height of 0.1 mm | take the large gauge |"
        in call(app, ["schema", "reasons"]).output
    )


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
    assert sorted(rule.__module__.rpartition(".")[2] for rule in rules) == sorted(set(files) - {"__init__"})
    assert len({rule.rank for rule in rules}) == len(rules)
