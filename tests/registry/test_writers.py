"""File formats that plugins add: found, used by a job, cleared away again; faults named."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from manifold3d import Manifold

import damageest
from damageest.artefacts import Solid
from damageest.cli._trials import try_plugins
from damageest.errors import JobError, StageError
from damageest.geometry.solids import to_arrays
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.export import Body
from tests import damaged_box
from tests.registry.test_registry import Site, site  # noqa: F401 - a fixture

COUNTED = """
from damageest.stages.export import Writer, ExportedFiles

def write(folder, stem, bodies, unit):
    text = "".join(f"{body.name}: {len(body.solid.faces)} {unit}\\n" for body in bodies)
    (folder / f"{stem}.count").write_text(text)
    return ExportedFiles((f"{stem}.count",), ("counted only",))

@hookimpl
def damageest_writers():
    return {NAME: Writer(write)}
"""


@pytest.mark.slow
def test_a_plugins_format_is_written_listed_and_cleared_away(site: Site, tiny_done: Path) -> None:  # noqa: F811
    site.add("acme-count", COUNTED.replace("NAME", "'count'"))
    text = tiny_done.read_text()
    tiny_done.write_text(text + "export: {format: [count, stl], frame: both}\n")
    assert Registry.discover().formats["count"].name == "acme-count"
    damageest.run(tiny_done, output=True)
    out = tiny_done.parent / "out/job"
    faces = (out / "damage/site-1.count").read_text()
    assert faces.startswith("damage site-1: ")
    assert faces.endswith(" mm\n")
    said = json.loads((out / "result.json").read_text())["export"]
    assert "scan_frame/undamaged.count" in said["files"]
    assert set(said["notes"]) == {"counted only"}
    (out / "mine.count").write_text("mine")
    damageest.run(tiny_done, output=True, settings=["export.format=stl", "export.frame=part"])
    left = {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file() and "stages" not in p.parts}
    assert {name for name in left if name.endswith(".count")} == {"mine.count"}
    assert not (out / "scan_frame").exists()


def test_a_format_that_is_there_already_and_what_is_no_writer_are_faults(site: Site) -> None:  # noqa: F811
    site.add("acme-again", COUNTED.replace("NAME", "'stl'"))
    site.add("acme-wrong", "@hookimpl\ndef damageest_writers():\n    return {'x': 3}\n")
    site.add("acme-fails", "@hookimpl\ndef damageest_writers():\n    raise OSError('no licence')\n")
    registry = Registry.discover()
    broken = {item.provider.name: item.reason for item in registry.broken}
    assert "writes stl, which another package writes already" in broken["acme-again"]
    assert "did not give a mapping of format names to Writers" in broken["acme-wrong"]
    assert "no licence" in broken["acme-fails"]
    assert {"stl", "ply", "3mf"} <= registry.writers.keys()
    assert "x" not in registry.writers
    assert registry.writers["stl"].write.__module__.startswith("damageest.")


def test_a_broken_plugin_is_named_where_its_format_is_asked_for(site: Site) -> None:  # noqa: F811
    site.add("acme-fails", "@hookimpl\ndef damageest_writers():\n    raise OSError('no licence')\n")
    folder = Path(tempfile.mkdtemp(dir=site.folder))
    path = damaged_box.write(folder, damaged_box.JOB + "export: {format: acme}\n")
    with pytest.raises(
        JobError, match=r"no format 'acme'; there are: .*acme-fails 1\.2 is broken \(OSError: no licence"
    ):
        damageest.run(path)


RUN_WRITER = """
from damageest.stages.export import Writer, ExportedFiles

def write(folder, stem, bodies, unit):
    BODY

@hookimpl
def damageest_writers():
    return {"acme": Writer(write)}
"""


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return [stem + '.acme']", "gave a list, and has to give an ExportedFiles"),
        ("return ExportedFiles((stem + '.acme',))", "says that it wrote box.acme, and there is no such file"),
        ("return ExportedFiles(('/etc/box.acme',))", "has to give paths relative to its folder"),
        ("open('/nowhere/licence.txt')", "failed: FileNotFoundError: [Errno 2] No such file or directory"),
        ("bodies[0].colour.red", "failed: AttributeError: 'tuple' object has no attribute 'red'"),
        ("raise SystemExit(4)", "failed: SystemExit: 4"),
    ],
)
def test_a_faulty_writer_is_named_with_its_package_function_and_hook(
    site: Site,  # noqa: F811
    tmp_path: Path,
    body: str,
    message: str,
) -> None:
    site.add("acme-cad", RUN_WRITER.replace("BODY", body))
    registry = Registry.discover()
    box = Body("box", Solid(*to_arrays(Manifold.cube((1, 2, 3)))), (0, 0, 0))
    with pytest.raises(StageError) as caught:
        registry.writers["acme"].write(tmp_path, "box", [box], "mm")
    assert "'acme' of acme-cad 1.2 (acme_cad.write, its `write`, from the hook damageest_writers)" in str(caught.value)
    assert message in caught.value.message
    assert "authors of acme-cad 1.2" in caught.value.remedy
    assert [fault for fault in try_plugins(registry)[1] if "acme-cad 1.2" in fault and message in fault]


OTHER_WRITERS = """
import numpy as np
from damageest.stages.export import ExportedFiles, PathWriter, Writer

def write(folder, stem, bodies, unit):
    (folder / f"{stem}.acme").write_text(unit)
    return ExportedFiles((f"{stem}.acme",))

def patch(path, name, patch, unit):
    return len(patch.poles)

def document(folder, result):
    return ExportedFiles((f"{result.sites[0].serial}.txt",))

def write_path(file, path, settings):
    file.write_text(str(path.points.speed))

def refuse(file, path, settings):
    raise StageError("this control needs a machine", "a machine file")

@hookimpl
def damageest_writers():
    return {"acme": Writer(write, patch=patch), "acme-all": Writer(write, document=document)}

@hookimpl
def damageest_path_writers():
    return {"acme-path": PathWriter(write_path, "nc"), "acme-robot": PathWriter(refuse, "src")}
"""


def test_doctor_calls_every_function_of_a_writer(site: Site, small_result: Result) -> None:  # noqa: F811
    """Splines, documents and paths too; a format of paths may refuse one without a machine."""
    site.add("acme-cad", "from damageest.errors import StageError" + OTHER_WRITERS)
    registry = Registry.discover()
    own = dict.fromkeys(name for name in registry.writers if name.startswith("acme"))
    paths = {name: one for name, one in registry.path_writers.items() if name.startswith("acme")}
    lone = replace(registry, writers={name: registry.writers[name] for name in own}, path_writers=paths, rules=())
    count, faults = try_plugins(lone, small_result)
    assert count == 4
    assert len(faults) == 3
    for fault, told in zip(
        sorted(faults), ["'acme' of acme-cad 1.2 (acme_cad.patch", "'acme-all' of", "'acme-path' of"], strict=True
    ):
        assert told in fault
        assert "gave a int, and has to give a text" in fault or "failed: AttributeError" in fault


ENDS = """
from damageest.artefacts import Reason
from damageest.rules import Rule

class Ends(Rule):
    code, meaning, threshold = "acme_ends", "ends", "always"
    def find_reasons(self, site, scan):
        import os
        os.abort()

class Sound(Rule):
    code, meaning, threshold = "acme_sound", "is sound", "never"
    def find_reasons(self, site, scan):
        return []

@hookimpl
def damageest_rules():
    return [Ends, Sound]
"""


@pytest.mark.slow
def test_doctor_outlives_a_rule_that_ends_its_process(site: Site) -> None:  # noqa: F811
    site.add("acme-ends", ENDS)
    registry = Registry.discover()
    rules = tuple(rule for rule in registry.rules if rule.owner)
    count, faults = try_plugins(replace(registry, rules=rules, writers={}, path_writers={}), apart=True)
    assert count == 2
    (fault,) = faults
    told = "the rule Ends ('acme_ends') of acme-ends 1.2: its process ended by an abort (SIGABRT); try: report it"
    assert fault.startswith(told)
