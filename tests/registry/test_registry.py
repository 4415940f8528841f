"""Plugins: found, used, broken, clashing; observers called."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import trimesh

import damageest
from damageest.cli._commands import load_commands
from damageest.errors import DamageestError, JobError
from damageest.registry import Registry
from damageest.registry.contracts import DEFAULTS
from damageest.registry.hookspecs import hookimpl
from tests import damaged_box
from tests.needs import PLUGINS, find_obstacle, needs_plugin

HEAD = "from typing import Literal\nfrom damageest.registry.hookspecs import hookimpl\n"
GROWN = '''
from damageest.artefacts import Solid
from damageest.stages.allowance import Allowance

class Doubled(Allowance):
    """Twice as large, about the origin."""
    use: Literal["doubled"] = "doubled"
    factor: float = 2.0
    def run(self, damage: Solid) -> Solid | None:
        return Solid(damage.vertices * self.factor, damage.faces)

@hookimpl
def damageest_stages():
    return [Doubled]
'''


class Site:
    """A folder on the path that packages with entry points can be put into."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def add(self, name: str, source: str) -> None:
        module = name.replace("-", "_")
        (self.folder / f"{module}.py").write_text(HEAD + source)
        info = self.folder / f"{module}-1.2.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\nLicense: MIT\n")
        (info / "entry_points.txt").write_text(f"[damageest]\n{module} = {module}\n")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    folder = tmp_path / "site"
    folder.mkdir()
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(folder))
    yield Site(folder)
    for name in set(sys.modules) - before:
        if getattr(sys.modules[name], "__file__", None) and str(folder) in str(sys.modules[name].__file__):
            del sys.modules[name]


def test_every_default_is_there(registry: Registry) -> None:
    for contract, name in DEFAULTS.items():
        assert registry.get(contract.stage, name).contract is contract
    assert not registry.clashes


def test_no_plugin_is_broken_but_for_a_missing_system_library(registry: Registry) -> None:
    hindered = {f"damageest-{plugin}" for plugin in PLUGINS if find_obstacle(plugin)}
    assert {fault.provider.name for fault in registry.broken} == hindered


@pytest.mark.parametrize("plugin", [pytest.param(plugin, marks=needs_plugin(plugin)) for plugin in PLUGINS])
def test_every_plugin_provides_something(plugin: str, registry: Registry) -> None:
    """Stages, commands or formats. Tests made for each implementation found, as of conformance, include the plugins'
    own."""
    name = f"damageest-{plugin}"
    formats = any(provider.name == name for provider in registry.formats.values())
    assert any(item.provider.name == name for item in registry.implementations) or load_commands().get(name) or formats


@pytest.mark.slow
def test_a_plugins_stage_runs(site: Site, tiny_done: Path) -> None:
    site.add("acme-grow", GROWN)
    assert any(str(p) == "acme-grow 1.2" and p.licence == "MIT" for p in Registry.discover().providers)
    result = damageest.run(tiny_done, settings=["allowance.use=doubled", "allowance.factor=1.5"], output=True)
    assert result.sites[0].deposit is not None
    assert result.sites[0].deposit.volume == pytest.approx(1.5**3 * result.damage_volume)


FAULTS = {
    "import nonexistent_thing": "pip install nonexistent_thing",
    "raise SystemExit(3)": "SystemExit",
    "@hookimpl\ndef damageest_stages():\n    return [int]": "derives from no contract",
    GROWN.replace("damage: Solid)", "damage: Solid, weather: int)"): "asks for 'weather'",
    GROWN.replace('Literal["doubled"] = "doubled"', 'str = "x"'): "Literal['name']",
    GROWN.replace("factor: float = 2.0", "takes: float = 2.0").replace("self.factor", "2"): "reserved",
}


@pytest.mark.parametrize("source", FAULTS)
def test_a_broken_plugin_stops_nothing(source: str, site: Site, tiny_done: Path) -> None:
    site.add("acme-broken", source)
    registry = Registry.discover()
    (fault,) = [fault for fault in registry.broken if fault.provider.name == "acme-broken"]
    assert FAULTS[source] in fault.reason + fault.remedy
    if source.startswith(("raise", "@hookimpl")):  # one that does not load, and one whose stage is none
        assert damageest.run(tiny_done, registry=registry, output=True).status == "ok"
    with pytest.raises(JobError, match=r"acme-broken 1\.2 is broken"):
        damageest.run(tiny_done, settings=["allowance=doubled"], registry=registry)


@pytest.mark.slow
def test_a_clash_names_both(site: Site, tiny_done: Path) -> None:
    site.add("acme-one", GROWN)
    site.add("acme-two", GROWN)
    assert damageest.run(tiny_done, output=True).status == "ok"
    with pytest.raises(JobError, match=r"acme-one 1\.2 and acme-two 1\.2"):
        damageest.run(tiny_done, settings=["allowance=doubled"])


@pytest.mark.parametrize(
    ("body", "text"),
    [
        ("return 7", "gave a int"),
        ("raise ValueError('odd')", "ValueError: odd"),
        ("return Solid(damage.vertices, damage.faces[1:])", "not watertight"),
    ],
)
def test_a_stage_that_misbehaves_is_named(body: str, text: str, site: Site, tiny_done: Path) -> None:
    site.add("acme-bad", GROWN.replace("return Solid(damage.vertices * self.factor, damage.faces)", body))
    result = damageest.run(tiny_done, settings=["allowance=doubled"], output=True)
    assert result.status == "incomplete"
    assert "allowance: doubled" in result.failures[0]
    assert text in result.failures[0]


PLANNER = """
from damageest.stages.path import Path

class Stuck(Path):
    \"\"\"Plans nothing.\"\"\"
    use: Literal["stuck"] = "stuck"

    def run(self, body):
        raise ValueError("no way out")

@hookimpl
def damageest_stages():
    return [Stuck]
"""


def test_a_path_that_cannot_be_planned_leaves_the_interval_of_the_total(site: Site, tiny_done: Path) -> None:
    site.add("acme-path", PLANNER)
    result = damageest.run(tiny_done, settings=["path=stuck"])
    assert "no way out" in result.failures[0]
    assert result.volume_95 is not None
    assert result.volume_95[0] < result.damage_volume < result.volume_95[1]


class Observer:
    def __init__(self) -> None:
        self.seen: list[tuple[str, str]] = []

    @hookimpl
    def damageest_before_stage(self, stage: str) -> None:
        self.seen.append(("before", stage))

    @hookimpl
    def damageest_after_stage(self, stage: str, output: object) -> None:
        assert output is not None or stage in ("allowance", "path")
        self.seen.append(("after", stage))

    @hookimpl
    def damageest_stage_failed(self, stage: str, error: Exception) -> None:
        self.seen.append((type(error).__name__, stage))


@pytest.mark.slow
def test_observers_see_every_stage(tiny_done: Path) -> None:
    observer = Observer()
    result = damageest.run(tiny_done, registry=Registry.discover([observer]))
    assert [stage for what, stage in observer.seen if what == "after"] == [record.stage for record in result.stages]
    observer.seen.clear()
    tiny_done.with_name("box.stl").write_bytes(b"solid nothing")
    with pytest.raises(DamageestError):
        damageest.run(tiny_done, registry=Registry.discover([observer]))
    assert observer.seen == [("before", "part"), ("InputError", "part")]


FIXTURE = '''
from typing import ClassVar
import numpy as np
from damageest.artefacts import Part, Pose, Scan
from damageest.stages.align import Align

class Fixture(Align):
    """The pose that the fixture holds."""
    use: Literal["fixture"] = "fixture"
    gives_fitted_pose: ClassVar[bool] = FITTED
    def run(self, part: Part, scan: Scan, tolerance: float) -> Pose:
        return Pose(np.eye(4), 0.05, 0.95, np.eye(4)[None])

@hookimpl
def damageest_stages():
    return [Fixture]
'''


@pytest.mark.slow
@pytest.mark.parametrize("fitted", [False, True])
def test_a_known_pose_of_a_stranger_counts_as_one(fitted: bool, site: Site) -> None:
    """A whole face that is worn by 0.8 mm may be an error of a pose that was fitted, and of no other. What the run asks
    is the class, not its name."""
    site.add("acme-fixture", FIXTURE.replace("FITTED", str(fitted)))
    worn = {"tool": "plane", "point": [0, 0, damaged_box.SIZE[2] / 2 - 0.8], "normal": [0, 0, 1]}
    scan = {"use": "simulate", "points": 6000, "noise": 0.04, "seed": 3, "pose": "identity", "damage": [worn]}
    job = {"version": 1, "tolerance": 0.4, "report": "none", "align": "fixture", "scan": scan}
    (found,) = damageest.run(job, part=trimesh.creation.box(damaged_box.SIZE)).sites
    assert ("wide_loss" in {reason.code for reason in found.verdict.reasons}) == fitted
