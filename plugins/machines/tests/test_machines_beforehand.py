"""What no program could be written for is told with the job, before a path is planned."""

from __future__ import annotations

from pathlib import Path

import pytest

from damageest.errors import JobError
from damageest.job import load
from damageest.registry import Registry
from tests import damaged_box
from tests.needs import needs_plugin

pytestmark = needs_plugin("paths", "machines")

PATH = """path:
  use: layers
  height: 1
  width: 2
  feed: 500
  nozzle: {tip_radius: 2, length: 40, body_radius: 10}
"""


@pytest.fixture(scope="module")
def registry() -> Registry:
    return Registry.discover()


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("beforehand")
    damaged_box.write(folder, points=100)
    (folder / "bad.yaml").write_text("name: mine\nlinear: []\nspeed: 3\n")
    (folder / "no.yaml").write_text("name: [")
    (folder / "latin.txt").write_bytes("G21 \xfc".encode("latin-1"))
    (folder / "open.stl").write_text("solid x\nendsolid x\n")
    return folder


def find_faults(home: Path, registry: Registry, more: str) -> list[str]:
    job = home / "job.yaml"
    job.write_text(damaged_box.JOB.replace("report: none\n", "") + more)
    try:
        load(job, registry)
    except JobError as error:
        return [line.removeprefix(str(job)) for line in error.lines()]
    return []


@pytest.mark.parametrize(
    ("export", "said"),
    [
        ("{paths: [krl]}", "krl: the format needs a machine; export.machine: a file, or a name"),
        ("{paths: [krl, rapid], machine: kukka}", "krl, rapid: there is no machine 'kukka'"),
        ("{paths: [sinumerik], machine: bad.yaml}", "bad.yaml:3: speed: "),
        ("{paths: [json], machine: no.yaml}", "no.yaml:1"),
        ("{paths: [krl], machine: vertical_5_axis}", None),
        ("{paths: [rs274], path_options: {rotary: XY}}", "rs274: rotary is 'XY'; auto, none, AC or BC"),
        ("{paths: [rs274], path_options: {tcp: table, pivot: 1 2}}", "pivot is '1 2'; three numbers"),
        ("{paths: [rs274], path_options: {onn: M3}}", "rs274 has no option onn"),
        ("{paths: [rs274], path_header: latin.txt}", "latin.txt cannot be read: it is no text in UTF-8"),
        ("{paths: [csv]}", ""),
    ],
)
def test_files_of_paths(export: str, said: str | None, home: Path, registry: Registry) -> None:
    if said is None:
        from damageest_machines.files import list_shipped, read_machine

        name = next(name for name, file in list_shipped().items() if read_machine(file).robot is None)
        export, said = f"{{paths: [krl], machine: {name}}}", "the format .src is for robots, and "
    faults = find_faults(home, registry, f"{PATH}export: {export}\n")
    assert len(faults) == (1 if said else 0), faults
    assert all(said in fault and "export" in fault for fault in faults), faults
    assert all(fault.startswith(":12:") for fault in faults), "the line of the export"


def test_channels_that_the_machine_has_no_command_for(home: Path, registry: Registry) -> None:
    from damageest_machines.files import list_shipped, read_machine

    name, file = next((n, f) for n, f in list_shipped().items() if read_machine(f).robot is None)
    known = next(iter(read_machine(file).process.channels), None)
    process = "  process: [{set: {plasma: 3}}]\n"
    (fault,) = find_faults(home, registry, f"{PATH}{process}export: {{paths: [sinumerik], machine: {name}}}\n")
    assert "the path has a channel 'plasma', for which" in fault
    if known:
        process = f"  process: [{{set: {{{known}: 3, speed: 400}}}}]\n"
        assert not find_faults(home, registry, f"{PATH}{process}export: {{paths: [sinumerik], machine: {name}}}\n")


def test_a_machine_matters_where_it_is_named_or_paths_are_planned(home: Path, registry: Registry) -> None:
    assert not find_faults(home, registry, "export: {paths: [krl]}\n")
    assert "no machine 'kukka'" in find_faults(home, registry, "export: {paths: [krl], machine: kukka}\n")[0]


def test_meshes_of_nozzle_and_fixture(home: Path, registry: Registry) -> None:
    path = PATH.replace("{tip_radius: 2, length: 40, body_radius: 10}", "{mesh: open.stl}") + "  fixture: scan.ply\n"
    faults = find_faults(home, registry, path)
    assert len(faults) == 2
    assert "nozzle: open.stl" in faults[0]
    assert "fixture: scan.ply" in faults[1]
