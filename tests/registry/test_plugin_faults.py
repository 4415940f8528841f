"""Plugins at fault: each is named with its reason, and stops nothing else."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

import damageest
from damageest.cli import app
from damageest.errors import DamageestError, PluginError
from damageest.registry import Registry
from tests import damaged_box
from tests.registry.test_registry import GROWN, Site, site

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
    "option run": (option("run: float = 2.0"), "'run' shadows a reserved name"),
    "option model_config": (option("model_config: float = 2.0"), "(acme_faulty.py, line 7)"),
    "exits on import": ("import sys\nsys.exit(3)", "SystemExit"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named(name: str, site: Site) -> None:
    source, text = FAULTS[name]
    site.add("acme-faulty", source)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        broken = Registry.discover().broken
    (fault,) = [fault for fault in broken if fault.provider.name.startswith("acme")]
    assert str(fault.provider) == "acme-faulty 1.2"
    assert text in fault.reason


@pytest.mark.parametrize("name", ["hook gives None", "invalid default", "exits on import"])
def test_the_commands_go_on_beside_a_fault(name: str, site: Site, job_file: Callable[..., Path]) -> None:
    site.add("acme-faulty", FAULTS[name][0])
    for words in (["--help"], ["stages"], ["schema", "job"], ["validate", str(job_file())]):
        assert CliRunner().invoke(app, words).exit_code == 0
    assert "acme-faulty" in CliRunner().invoke(app, ["plugins"]).output


def test_one_package_that_provides_a_name_twice(site: Site) -> None:
    site.add("acme-twice", GROWN.replace(HOOK, "return [Doubled, type('Again', (Doubled,), {'__module__': __name__})]"))
    registry = Registry.discover()
    with pytest.raises(PluginError, match=r"acme-twice 1\.2 provides 'doubled' of stage 'allowance' more than once"):
        registry.get("allowance", "doubled")


@pytest.mark.slow
def test_a_stage_that_prints_leaves_json_alone(site: Site, tiny_done: Path) -> None:
    site.add("acme-loud", GROWN.replace(BODY, f"print('hello'); {BODY}"))
    done = CliRunner().invoke(app, ["run", "--json", str(tiny_done), "--set", "allowance=doubled"])
    assert json.loads(done.stdout)["status"] == "ok"
    assert "hello" in done.stderr


MISBEHAVIOUR = {
    "edits its inputs": ("damage.vertices[0] = 0; return damage", "tried to edit what it was given"),
    "open mesh": ("return Solid(damage.vertices, damage.faces[1:])", "gave a result that is not valid: not watertight"),
    "leaves a bubble": (
        "from damageest.geometry.solids import to_manifold, to_solid; middle = damage.bounds.mean(axis=0); "
        "body = to_manifold(damage, middle); return to_solid(body - body.scale((0.3, 0.3, 0.3)), middle)",
        "the deposit encloses an empty space of 13",
    ),
    "raises": ("raise IndexError('7')", "failed unexpectedly: IndexError: 7"),
    "lacks a module": ("import nonexistent_thing", "the Python module nonexistent_thing is not installed"),
    "lacks a library": (
        "raise ImportError('libacme.so.1: cannot open shared object file: No such file')",
        "the system library libacme.so.1 is missing",
    ),
}
FORGETFUL = '''
from damageest.stages.cluster import Cluster

class Forgets(Cluster):
    """Forgets to return."""
    use: Literal["forgets"] = "forgets"
    def run(self, deviation):
        pass

@hookimpl
def damageest_stages():
    return [Forgets]
'''
HANGING = '''
import time
from damageest.artefacts import Scan
from damageest.stages.scan import ReadScan

class Hangs(ReadScan):
    """Does not end."""
    use: Literal["hangs"] = "hangs"
    def run(self, unit: str) -> Scan:
        open(HUNG, "w").close()
        time.sleep(600)

@hookimpl
def damageest_stages():
    return [Hangs]
'''


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", MISBEHAVIOUR)
def test_what_a_stage_does_wrong_is_said_with_whose_it_is(name: str, site: Site, tiny_done: Path) -> None:
    body, text = MISBEHAVIOUR[name]
    site.add("acme-bad", GROWN.replace(BODY, body))
    done = CliRunner().invoke(app, ["run", str(tiny_done), "--set", "allowance=doubled"])
    assert done.exit_code == 1
    told = " ".join(done.output.split())
    assert f"allowance: doubled (site 1): {text}" in told
    assert "acme-bad 1.2" in told or name.startswith(("lacks", "leaves"))


def test_none_where_the_contract_has_none(site: Site, tiny_done: Path) -> None:
    site.add("acme-none", FORGETFUL)
    done = CliRunner().invoke(app, ["run", str(tiny_done), "--set", "cluster=forgets"])
    assert done.exit_code == 1
    assert "gave a NoneType where its contract promises Sites" in " ".join(done.output.split())


DAMAGED = {
    "no module": ("[damageest]\nx = \n", "Name: acme-half\nVersion: 1.2\n", "acme-half", "it is no module"),
    "no value": ("[damageest]\nwords\n", "Name: acme-half\nVersion: 1.2\n", "acme-half", "its entry points cannot be"),
    "no metadata": ("[damageest]\nx = acme_half\n", None, "acme_half", "No module named 'acme_half'"),
    "no name": ("[damageest]\nx = acme_half\n", "Version: 1.2\n", "acme_half", "No module named 'acme_half'"),
    "no text": (
        "[damageest]\nx = acme_half\n",
        "\ud8ff",
        "acme_half",
        "its entry point 'x = acme_half' cannot be read",
    ),
    "another's": ("[console_scripts]\nwords\n", "Name: acme-half\nVersion: 1.2\n", "", ""),
}
"""What an installation that was interrupted leaves: entry points, metadata, who is broken and why."""


@pytest.mark.parametrize("case", DAMAGED)
def test_a_damaged_installation_of_one_package_costs_that_package_alone(case: str, site: Site) -> None:
    points, metadata, name, reason = DAMAGED[case]
    site.add("acme-grow", GROWN)
    info = site.folder / "acme_half-1.2.dist-info"
    info.mkdir()
    (info / "entry_points.txt").write_text(points)
    if metadata is not None:
        (info / "METADATA").write_bytes(f"Metadata-Version: 2.1\n{metadata}".encode("utf-8", "surrogatepass"))
    registry = Registry.discover()
    assert registry.get("allowance", "doubled").provider.name == "acme-grow"
    broken = {one.provider.name: one.reason for one in registry.broken if "half" in one.provider.name}
    assert list(broken) == ([name] if name else [])
    assert reason in broken.get(name, "")


OBSERVING = """
@hookimpl
def damageest_before_stage(stage):
    raise OSError("no disk for my log")
"""


def test_an_observer_that_fails_is_named_with_its_package(site: Site, tiny_done: Path) -> None:
    site.add("acme-log", OBSERVING)
    tiny_done.with_name("box.stl").write_bytes(b"solid nothing")
    said = "acme-log, which observes stage part, failed: OSError: no disk for my log"
    with pytest.warns(RuntimeWarning, match=said), pytest.raises(DamageestError):
        damageest.run(tiny_done)


def test_a_module_without_hooks_provides_nothing(site: Site) -> None:
    site.add("acme-empty", "")
    assert "acme-empty" not in {fault.provider.name for fault in Registry.discover().broken}
    assert "acme-empty 1.2  MIT  no stages" in CliRunner().invoke(app, ["plugins"]).output


@pytest.mark.slow
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, -signal.SIGTERM)])
def test_a_stage_that_hangs_can_be_stopped(
    number: int, status: int, site: Site, tiny_done: Path, tmp_path: Path
) -> None:
    out = tiny_done.parent / "out" / "job"
    before = damaged_box.content(out)
    assert before
    hung = tmp_path / "hung"
    site.add("acme-hang", HANGING.replace("HUNG", repr(str(hung))))
    text = tiny_done.read_text()
    tiny_done.write_text(text.replace("scan: scan.ply", "scan: {use: hangs}"))
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site.folder), os.environ.get("PYTHONPATH", "")])}
    stuck = [sys.executable, "-c", "from damageest.cli import main; main()", "run", "-q", str(tiny_done)]

    def allow_interrupts() -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # shells let what runs in the background ignore it

    with subprocess.Popen(stuck, env=env, stderr=subprocess.PIPE, text=True, preexec_fn=allow_interrupts) as process:
        try:
            while not hung.exists():
                assert process.poll() is None, process.communicate()[1]
                time.sleep(0.05)
            process.send_signal(number)
            said = process.communicate(timeout=30)[1]
            assert process.returncode == status
            assert ("the same command continues" in said) == (number == signal.SIGINT)
        finally:
            process.kill()
    assert damaged_box.content(out) == before
    tiny_done.write_text(text)
    assert damageest.run(tiny_done, output=True).status == "ok"


STOPPED = """
stopped = ImportError("initialization failed")
stopped.__cause__ = KeyboardInterrupt()
"""


@pytest.mark.parametrize("place", ["import", "hook", "run"])
def test_an_interrupted_import_is_no_fault_of_the_plugin(place: str, site: Site, tiny_done: Path) -> None:
    """A compiled module raises ImportError where Ctrl-C stops its import."""
    source = {
        "import": STOPPED + "raise stopped",
        "hook": STOPPED + GROWN.replace(HOOK, "raise stopped"),
        "run": STOPPED + GROWN.replace(BODY, "raise stopped"),
    }[place]
    site.add("acme-stopped", source)
    before = damaged_box.content(tiny_done.parent / "out")
    with pytest.raises(KeyboardInterrupt):
        damageest.run(tiny_done, settings=["allowance=doubled"], output=True)
    assert damaged_box.content(tiny_done.parent / "out") == before


def test_a_plugin_that_lacks_a_library_is_broken_with_a_remedy(site: Site) -> None:
    site.add("acme-lacks", "raise ImportError('libacme.so.1: cannot open shared object file: No such file')")
    (fault,) = [fault for fault in Registry.discover().broken if fault.provider.name == "acme-lacks"]
    assert fault.remedy == "install the system package that has libacme.so.1"


def test_third_party_stages_are_shown_with_their_options(site: Site) -> None:
    source = GROWN.replace("factor: float = 2.0", 'factor: float = Field(2.0, gt=1, description="how much larger")')
    site.add("acme-grow", "from pydantic import Field\n" + source)
    shown = CliRunner().invoke(app, ["stages", "allowance", "doubled"]).output
    assert "acme-grow 1.2, MIT" in shown
    assert "how much larger (default 2.0)" in shown
    assert "doubled" in CliRunner().invoke(app, ["stages"]).output
    schema = json.loads(CliRunner().invoke(app, ["schema", "job"]).output)
    own = schema["$defs"]["Doubled"]["properties"]
    assert own["use"] == {"const": "doubled", "description": "by acme-grow"}
    assert own["factor"]["exclusiveMinimum"] == 1
    assert {"$ref": "#/$defs/Doubled"} in schema["properties"]["allowance"]["anyOf"]
