"""Plugins at fault: each is named with its reason, and stops nothing else."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import pytest
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import PluginError
from damageest.registry import Registry
from tests import damaged_box
from tests.test_registry import GROWN, Site, site

__all__ = ["site"]
BODY = "return Solid(damage.vertices * self.factor, damage.faces)"
HOOK = "return [Doubled]"


def option(text: str) -> str:
    return GROWN.replace("factor: float = 2.0", text).replace("self.factor", "2")


FAULTS = {
    "hook gives no list": (GROWN.replace(HOOK, "return Doubled"), "instead of a list"),
    "hook gives None": (GROWN.replace(HOOK, "return None"), "gave a NoneType"),
    "variable arguments": (GROWN.replace("damage: Solid)", "*args, **kwargs)"), "without *args"),
    "option json": (option("json: float = 2.0"), "'json' shadows a reserved name"),
    "option copy": (option("copy: bool = True"), "'copy' shadows a reserved name"),
    "option stage": (option("stage: float = 2.0"), "'stage' shadows a reserved name"),
    "invalid default": (option('factor: float = "much"'), "default of an option is not valid: factor"),
    "exits on import": ("import sys\nsys.exit(3)", "SystemExit"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_and_the_commands_go_on(name: str, site: Site, tmp_path: Path) -> None:
    source, text = FAULTS[name]
    site.add("acme-faulty", source)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        broken = Registry.discover().broken
    assert [str(fault.provider) for fault in broken] == ["acme-faulty 1.2"]
    assert text in broken[0].reason
    job = str(damaged_box.write(tmp_path))
    for words in (["--help"], ["stages"], ["validate", job]):
        assert CliRunner().invoke(app, words).exit_code == 0
    assert "acme-faulty" in CliRunner().invoke(app, ["plugins"]).output


def test_one_package_that_provides_a_name_twice(site: Site) -> None:
    site.add("acme-twice", GROWN.replace(HOOK, "return [Doubled, type('Again', (Doubled,), {'__module__': __name__})]"))
    registry = Registry.discover()
    with pytest.raises(PluginError, match=r"acme-twice 1\.2 provides 'doubled' of stage 'allowance' more than once"):
        registry.get("allowance", "doubled")


def test_a_stage_that_prints_leaves_json_alone(site: Site, tmp_path: Path) -> None:
    site.add("acme-loud", GROWN.replace(BODY, f"print('hello'); {BODY}"))
    job = damaged_box.write(tmp_path, damaged_box.JOB + "allowance: doubled\n")
    done = CliRunner().invoke(app, ["run", "--json", str(job)])
    assert json.loads(done.stdout)["status"] == "ok"
    assert "hello" in done.stderr
