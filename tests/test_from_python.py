"""A program that calls `damageest.run`: progress, cancel, results kept, what parts and scans may be, failures."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pytest
import trimesh

import damageest
from damageest.errors import CancelledError, DamageestError, InputError
from damageest.geometry.solids import to_manifold
from damageest.io.given import as_scan
from damageest.pipeline.notebook import show_in
from damageest.result import Result
from tests import damaged_box
from tests.needs import import_or_skip

LEAST = {"version": 1, "tolerance": 0.4, "align": "none"}


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    text = damaged_box.JOB.replace("tolerance: 0.2", "tolerance: 0.4")
    return damaged_box.write(tmp_path_factory.mktemp("python"), text, 2000)


@pytest.fixture(scope="module")
def ran(job: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result, list[damageest.Progress]]:
    """The output folder of a run, its result and its progress."""
    seen: list[damageest.Progress] = []
    folder = tmp_path_factory.mktemp("ran") / "out"
    return folder, damageest.run(job, output=folder, progress=seen.append), seen


def test_progress_rises_from_the_first_stage_to_one(ran: tuple[Path, Result, list[damageest.Progress]]) -> None:
    seen = ran[2]
    shares = [one.share for one in seen]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0, 1)
    assert [one.seconds for one in seen] == sorted(one.seconds for one in seen)
    assert {("part", "file"), ("boolean", "manifold")} <= {(one.stage, one.use) for one in seen}


@pytest.mark.slow
def test_a_later_run_tells_the_progress_of_an_earlier_one_nothing(job: Path) -> None:
    seen: list[damageest.Progress] = []
    registry = damageest.Registry.discover()
    damageest.run(job, progress=seen.append, registry=registry)
    before = len(seen)
    damageest.run(job, registry=registry)
    assert len(seen) == before


def cancel_after_segment(job: Path, folder: Path) -> float:
    """Processor seconds from the cancel, shortly after the stage segment began, to the end of the run."""
    cancel, at = threading.Event(), [0.0]

    def cancel_soon(now: damageest.Progress) -> None:
        if now.stage == "segment":
            threading.Timer(0.01, lambda: (at.__setitem__(0, time.process_time()), cancel.set())).start()

    with pytest.raises(CancelledError) as caught:
        damageest.run(job, progress=cancel_soon, cancel=cancel, output=folder, cache=False)
    assert caught.value.code == "cancelled"
    assert "align" in {record.stage for record in caught.value.so_far.stages}
    return time.process_time() - at[0]


def test_a_cancelled_run_ends_within_a_second_and_leaves_nothing(job: Path, tmp_path: Path) -> None:
    threads, children = threading.active_count(), set(psutil.Process().children())
    assert cancel_after_segment(job, tmp_path / "out") < 1
    assert not set(psutil.Process().children()) - children  # those of tests before it go on
    assert threading.active_count() <= threads
    assert not list(tmp_path.glob(".out*")), "no half-written folder"


@pytest.mark.slow
def test_the_thread_of_a_cancelled_run_goes_on_as_before(job: Path, tmp_path: Path) -> None:
    cancel_after_segment(job, tmp_path / "out")
    assert damageest.run(job).status == "ok"


def test_a_caller_cancels_from_progress_too(job: Path) -> None:
    """As of other libraries: by raising what a cancelled run raises."""

    def stop(now: damageest.Progress) -> None:
        if now.stage == "segment":
            raise CancelledError

    for cancel in (None, threading.Event()):
        with pytest.raises(CancelledError) as caught:
            damageest.run(job, progress=stop, cancel=cancel)
        assert [record.stage for record in caught.value.so_far.stages][-1] == "align"


def test_a_cancel_that_was_set_before_begins_nothing(job: Path) -> None:
    cancel = threading.Event()
    cancel.set()
    with pytest.raises(CancelledError):
        damageest.run(job, cancel=cancel, progress=lambda now: pytest.fail("it began"))


def test_a_result_is_kept_and_read_again(ran: tuple[Path, Result, list[damageest.Progress]], tmp_path: Path) -> None:
    folder, result, _ = ran
    written = json.loads((folder / "result.json").read_text())
    told = result.to_dict()
    assert told.keys() == written.keys()
    of_files = {"export", "provenance", "scan", "part", "sites", "stages", "steps", "warnings"}
    assert {key: told[key] for key in told.keys() - of_files} == {key: written[key] for key in told.keys() - of_files}
    assert told["sites"][0]["volume"] == written["sites"][0]["volume"]
    again = Result.load(result.save(tmp_path / "kept"))
    assert again.to_dict() == told == json.loads((tmp_path / "kept/result.json").read_text())
    assert np.array_equal(again.sites[0].damage.vertices, result.sites[0].damage.vertices)
    assert np.array_equal(again.site_label, result.site_label)
    assert to_manifold(again.mesh("undamaged")).volume() == pytest.approx(result.undamaged_volume)
    text = (tmp_path / "kept/result-values.json").read_text()
    (tmp_path / "kept/result-values.json").write_text(text.replace("damageest.result:Result", "subprocess:Popen"))
    with pytest.raises(InputError, match="is no value of damageest"):
        Result.load(tmp_path / "kept")
    with pytest.raises(InputError, match="holds no result that was saved"):
        Result.load(tmp_path)


@pytest.mark.slow
def test_a_cache_in_memory_serves_the_next_run_with_the_same_bytes(job: Path) -> None:
    kept = damageest.MemoryCache()
    first, again = (damageest.run(job, cache=kept) for _ in range(2))
    assert {record.cached for record in first.stages} == {False}
    assert all(record.cached for record in again.stages if record.stage != "report")
    assert first.to_dict()["sites"] == again.to_dict()["sites"]
    changed = damageest.run(job, cache=kept, settings={"cluster.neighbours": 12})
    assert {record.stage: record.cached for record in changed.stages}["part"]
    assert not {record.stage: record.cached for record in changed.stages}["cluster"]
    small = damageest.MemoryCache(most=2)
    damageest.run(job, cache=small)
    assert len(small._kept) == 2


def make_shapes(library: str) -> tuple[Any, Any]:
    """The part and the scan as objects of a library."""
    box, points = trimesh.creation.box(damaged_box.SIZE), damaged_box.scan(2000)
    if library == "pyvista":
        pyvista = import_or_skip("pyvista")
        return pyvista.wrap(box), pyvista.PolyData(points)
    if library == "trimesh scene":  # as `trimesh.load` gives, with a place for each of its meshes
        moved = trimesh.transformations.translation_matrix((7, 8, 9))
        scenes = trimesh.Scene(), trimesh.Scene()
        for scene, shape in zip(scenes, (box.copy(), trimesh.PointCloud(points)), strict=True):
            shape.apply_transform(np.linalg.inv(moved))
            scene.add_geometry(shape, transform=moved)
        return scenes
    if library == "open3d tensors":
        o3d = import_or_skip("open3d")
        mesh, cloud = make_shapes("open3d")
        return o3d.t.geometry.TriangleMesh.from_legacy(mesh), o3d.t.geometry.PointCloud.from_legacy(cloud)
    if library == "open3d":
        o3d = import_or_skip("open3d")
        mesh = o3d.geometry.TriangleMesh(
            o3d.utility.Vector3dVector(np.array(box.vertices)), o3d.utility.Vector3iVector(np.array(box.faces))
        )
        return mesh, o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(points)))
    if library == "trimesh":
        return box, trimesh.PointCloud(points)
    return (box.vertices, box.faces), points


@pytest.mark.slow
@pytest.mark.parametrize("library", ["numpy", "trimesh", "trimesh scene", "pyvista", "open3d", "open3d tensors"])
def test_parts_and_scans_of_other_libraries(library: str) -> None:
    part, scan = make_shapes(library)
    result = damageest.run(LEAST, part=part, scan=scan)
    assert result.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.1)


def test_arrays_that_trimesh_watches_are_arrays() -> None:
    cloud = trimesh.PointCloud(damaged_box.scan(100)).vertices
    assert type(cloud).__module__.startswith("trimesh.")
    assert np.array_equal(as_scan(cloud, "mm").points, cloud)


@pytest.mark.parametrize(
    ("part", "scan", "message"),
    [
        ("box", {"x": 1}, "scan: a dict cannot be used (it holds no points); give a damageest Scan, an array (N,3), a"),
        ("box", "abc.ply", None),
        ("box", [["a", "b", "c"]], "scan: a list cannot be used (could not convert string to float"),
        ("box", SimpleNamespace(), "scan: a types.SimpleNamespace cannot be used"),
        (
            "box",
            np.ones((9, 3), complex),
            "of shape (9, 3) cannot be used (its numbers are complex)",
        ),
        ("box", np.ma.masked_equal(np.arange(27.0).reshape(9, 3), 4), "scan: 1 of its points are not finite"),
        ("box", trimesh.Scene(), "scan: a trimesh.scene.scene.Scene cannot be used (nothing in it has vertices)"),
        (7, "points", "part: a int cannot be used (it has no vertices and faces); give a damageest Part, a trimesh"),
        ((np.zeros((3, 3)), np.zeros((1, 3))), "points", "its faces are no numbers of vertices"),
    ],
)
def test_what_is_no_part_or_scan_is_refused_with_what_is_taken(part: Any, scan: Any, message: str | None) -> None:
    if message is None:
        return
    part = trimesh.creation.box(damaged_box.SIZE) if isinstance(part, str) else part
    scan = damaged_box.scan(100) if isinstance(scan, str) else scan
    with pytest.raises(InputError) as caught:
        damageest.run(LEAST, part=part, scan=scan)
    assert message in str(caught.value)


@pytest.mark.slow
def test_settings_are_taken_as_a_mapping(job: Path) -> None:
    settings = {"tolerance": "0.5", "cluster.neighbours": 12, "sites": {"drop": []}}
    assert damageest.run(job, settings=settings).tolerance == 0.5


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"settings": "tolerance=0.5"}, "settings: give a list, ['tolerance=0.5'], or a mapping"),
        ({"settings": 7}, "settings: give a list, ['tolerance=0.2'], or a mapping"),
        ({"cache": "memory"}, "cache: a str cannot be used; give True, False or a damageest.MemoryCache"),
        ({"progress": 5}, "progress: a int cannot be used; give a function of one damageest.Progress"),
        ({"cancel": True}, "cancel: a bool cannot be used; give a threading.Event, or what has is_set()"),
    ],
)
def test_an_argument_of_another_type_is_refused_before_the_work(job: Path, given: Any, message: str) -> None:
    with pytest.raises(InputError) as caught:
        damageest.run(job, **given)
    assert message in str(caught.value)


@pytest.mark.filterwarnings("always")
def test_progress_that_fails_is_told_once_and_costs_no_run(job: Path) -> None:
    told: list[damageest.Progress] = []

    def fail(now: damageest.Progress) -> None:
        told.append(now)
        raise ValueError("the window is closed")

    with pytest.warns(RuntimeWarning) as seen, pytest.raises(DamageestError, match=r"sites\.drop names site 9"):
        damageest.run(job, settings={"sites.drop": [9]}, progress=fail)
    assert [str(one.message) for one in seen] == [
        "progress failed at part: ValueError: the window is closed; the run goes on, and it is not called again"
    ]
    assert len(told) == 1


def test_the_public_names_are_listed() -> None:
    assert {"run", "batch", "Result", "MemoryCache", "Progress"} <= set(dir(damageest))


def test_a_failing_run_has_what_was_computed(job: Path) -> None:
    with pytest.raises(DamageestError, match=r"sites\.drop names site 9") as caught:
        damageest.run(job, settings={"sites": {"drop": [9]}})
    found = caught.value.so_far
    assert found.pose is not None
    assert len(found.deviation.distance) == 2000
    assert found.result is None
    assert {"part", "scan", "align", "segment", "boolean"} <= {record.stage for record in found.stages}


def test_a_notebook_shows_progress_by_itself() -> None:
    import_or_skip("IPython")
    from IPython.core.interactiveshell import InteractiveShell
    from IPython.utils.capture import capture_output

    shell = InteractiveShell.instance()
    with capture_output():
        show = show_in(shell)
        show(damageest.Progress("align", "register", 0, "", 0.25, 3.0))


CALLER = """
import threading
import numpy as np
import damageest

def tell(now: damageest.Progress) -> None:
    print(f"{now.share:.0%} {now.stage} {now.seconds:.1f}")

result = damageest.run("job.yaml", progress=tell, cancel=threading.Event(), cache=damageest.MemoryCache(),
                       settings={"tolerance": 0.2}, scan=np.zeros((3, 3)))
volume: float = result.damage_volume
folder = result.save("kept")
again: damageest.Result = damageest.Result.load(folder)
damageest.run("job.yaml", settings={1: 2})
"""


@pytest.mark.slow
def test_hints_are_complete_for_a_caller_who_is_strict(tmp_path: Path) -> None:
    import_or_skip("mypy")
    (tmp_path / "caller.py").write_text(CALLER)
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "caller.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    errors = [line for line in done.stdout.splitlines() if ": error:" in line]
    assert len(errors) == 1, done.stdout
    assert "caller.py:14" in errors[0]


PAGE = Path(__file__).parents[1] / "docs/python.md"


@pytest.mark.slow
def test_the_code_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In its order, as one program, with a small job in place of the repository's."""
    text = PAGE.read_text()
    assert len(text.splitlines()) <= 80
    damaged_box.write_small(tmp_path / "jobs").rename(tmp_path / "jobs/block_wedge.yaml")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"mesh": trimesh.creation.box(damaged_box.SIZE), "points": damaged_box.scan(6000)}
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) >= 5
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names)
    assert names["bore"].is_watertight
    assert names["result"].tolerance == 0.2
    assert (tmp_path / "out/block/result.json").is_file()
    assert (tmp_path / "out/kept/result.json").is_file()
