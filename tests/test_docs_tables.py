"""The tables of the documentation list what this repository provides."""

from __future__ import annotations

from pathlib import Path

import pytest

from damageest.registry import Registry
from damageest.registry.contracts import DEFAULTS, STAGES
from tests.job.test_schema import own
from tests.needs import PLUGINS, needs_plugin

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


def read_table(text: str, head: str) -> list[list[str]]:
    """The lines of the Markdown table with a head, as lists of words."""
    lines = text.partition(head)[2].splitlines()[1:]  # without the rule
    rows = lines[: next((number for number, line in enumerate(lines) if not line.startswith("|")), len(lines))]
    return [[word.strip() for word in row.strip("|").split("|")] for row in rows]


def list_provided(registry: Registry) -> dict[str, list[str]]:
    """Stage to the names of its implementations in this repository, the defaults first."""
    return {stage: [item.name for item in own(registry).of(stage)] for stage in STAGES}


@needs_plugin(*PLUGINS)
def test_the_page_of_stages_lists_every_implementation(registry: Registry) -> None:
    rows = read_table((DOCS / "stages.md").read_text(), "| stage | implementation | when to take it |\n")
    listed: dict[str, list[str]] = {}
    for stage, name, when in rows:
        listed.setdefault(stage or list(listed)[-1], []).append(name)
        assert when
    names = {stage: [name.partition(" (")[0].strip("*") for name in each] for stage, each in listed.items()}
    assert list(names) == list(STAGES)
    assert {stage: sorted(each) for stage, each in names.items()} == {
        stage: sorted(each) for stage, each in list_provided(registry).items()
    }
    packages = {(i.contract.stage, i.name): i.provider.name for i in own(registry).implementations}
    for stage, each in listed.items():
        for name in each:
            bare, _, plugin = name.partition(" (plugin ")
            bold = bare.startswith("**")
            assert bold == (name == each[0]), "the first is the default, and bold"
            package = packages[stage, bare.strip("*")]
            assert package == (f"damageest-{plugin.strip(')')}" if plugin else "damageest")


@pytest.mark.parametrize("contract", DEFAULTS, ids=lambda contract: contract.__name__)
def test_the_page_of_contracts_has_what_each_may_ask_for(contract: type) -> None:
    text = (DOCS / "contracts.md").read_text()
    section = text.partition(f"\n## {contract.stage}\n")[2].partition("\n## ")[0]  # type: ignore[attr-defined]
    section = section[section.index(f"`{contract.__name__}`, once per ") :]
    often = "site" if contract.per_site else "job"  # type: ignore[attr-defined]
    assert section.startswith(f"`{contract.__name__}`, once per {often}")
    rows = read_table(section, "| may ask for | type | meaning |\n")
    assert [row[0].strip("`") for row in rows] == list(contract.takes())  # type: ignore[attr-defined]


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150
