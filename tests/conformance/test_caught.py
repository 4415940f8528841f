"""The checks detect implementations that do not keep their contract."""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from damageest_paths.layers import Layers, Nozzle

from damageest import conformance
from damageest.artefacts import (
    AdaptedPart,
    DepositPath,
    Enclosures,
    Mesh,
    Part,
    Pose,
    Rims,
    Samples,
    Scan,
    Sites,
    Solid,
)
from damageest.conformance import _scene
from damageest.conformance._base import PlacementContract, StageContract, to_bytes
from damageest.io.meshes import write_stl
from damageest.result import Result
from damageest.stages.adapt import Adapt
from damageest.stages.align.none import KnownPose
from damageest.stages.allowance.none import NoAllowance as NoAllowance
from damageest.stages.background.bbox import BoundingBox
from damageest.stages.boolean.manifold import Manifold
from damageest.stages.boundary.all_loops import AllLoops
from damageest.stages.cluster.dbscan import Dbscan
from damageest.stages.enclose.adaptive import Adaptive
from damageest.stages.enclose.implicit import Implicit
from damageest.stages.export import ExportedFiles
from damageest.stages.export.files import Files
from damageest.stages.part.file import PartFile
from damageest.stages.reconstruct.signed_distance import SignedDistance
from damageest.stages.repair.none import NoRepair as NoRepair
from damageest.stages.report import Report, ReportFiles
from damageest.stages.sample.uniform import Uniform
from damageest.stages.scan.simulate import Simulate
from damageest.stages.segment.mesh_distance import MeshDistance

BEADS = Layers(
    height=0.25, width=0.4, feed=60, nozzle=Nozzle(tip_radius=0.2, length=20, body_radius=2), standoff=1, simulate=False
)


class Still(Adapt):
    """Leaves the part as it is, in the words of one that was deformed."""

    use: Literal["still"] = "still"

    def run(self, part: Part) -> AdaptedPart | None:
        still = np.zeros(part.vertices.shape)
        return AdaptedPart(part, still, np.eye(4), still[None], 0.0, 0.0)


class Sentence(Report):
    """Writes one sentence."""

    use: Literal["sentence"] = "sentence"

    def run(self, result: Result, folder: Path) -> ReportFiles:
        (folder / "report.txt").write_text(f"{len(result.sites)} sites, {result.damage_volume:.6g}\n")
        return ReportFiles(("report.txt",))


GOOD: dict[str, tuple[Any, dict[str, Any]]] = {
    "Part": (PartFile(path=Path("prism.stl")), {"volume": _scene.make_prism().volume}),
    "Scan": (Simulate(points=5000), {}),
    "Sample": (Uniform(), {}),
    "Align": (KnownPose(), {"pose": np.eye(4)}),
    "Adapt": (Still(), {}),
    "Segment": (MeshDistance(), {}),
    "Cluster": (Dbscan(), {}),
    "Reconstruct": (SignedDistance(), {}),
    "Boundary": (AllLoops(), {}),
    "Background": (BoundingBox(), {}),
    "Enclose": (Adaptive(), {}),
    "EncloseAll": (Implicit(), {}),
    "Repair": (NoRepair(), {}),
    "Boolean": (Manifold(), {}),
    "Allowance": (NoAllowance(), {}),
    "Path": (BEADS, {}),
    "Export": (Files(), {}),
    "Report": (Sentence(), {}),
}
MEANING = {
    "Part": "test_has_the_volume_of_its_file",
    "Scan": "test_lies_on_what_was_scanned",
    "Sample": "test_lies_on_the_part",
    "Align": "test_finds_the_pose",
    "Adapt": "test_follows_skin_and_not_damage",
    "Segment": "test_labels_the_dents",
    "Cluster": "test_one_site_for_each_dent",
    "Reconstruct": "test_follows_the_dent",
    "Boundary": "test_the_open_edges_of_a_dent",
    "Background": "test_holds_the_damage",
    "Enclose": "test_holds_the_damage_and_no_intact_points",
    "EncloseAll": "test_holds_the_damage_and_no_intact_points",
    "Repair": "test_what_is_closed_keeps_its_volume",
    "Boolean": "test_gives_what_lies_in_the_part",
    "Allowance": "test_deposit_holds_the_damage",
    "Path": "test_beads_lie_at_the_deposit",
    "Export": "test_writes_the_files_it_names",
    "Report": "test_writes_the_files_it_names",
}
"""By contract: the check of the meaning of a result."""
BAD_INPUT: dict[str, tuple[str, tuple[Any, ...]]] = {
    "Align": ("test_few_points", (3,)),
    "Adapt": ("test_few_points", (30,)),
    "Segment": ("test_few_points", (0,)),
    "Cluster": ("test_few_points", (4,)),
    "Reconstruct": ("test_few_points", (0,)),
    "Boundary": ("test_an_empty_surface", ()),
    "Background": ("test_an_empty_surface", ()),
    "Enclose": ("test_no_rim", ()),
    "EncloseAll": ("test_no_sites_no_enclosures", ()),
    "Repair": ("test_an_empty_mesh_is_refused", ()),
    "Boolean": ("test_apart_gives_none", ()),
}
PLACED = [n for n in GOOD if issubclass(getattr(conformance, f"{n}Contract"), PlacementContract) and n != "Boundary"]
"""Rims are numbers of vertices and have no length."""
Fault = Callable[[Any, dict[str, Any]], Any]


def spoil(value: Any, by: float) -> Any:
    """A result with an error of ``by``, in the job's unit if it has lengths."""
    match value:
        case Mesh() | Samples() | Scan():
            points = value.vertices if isinstance(value, Mesh) else value.points
            name = "vertices" if isinstance(value, Mesh) else "points"
            low = points.min(axis=0)
            return replace(value, **{name: low + (points - low) * (1 + by / np.ptp(points, axis=0).max())})
        case AdaptedPart():
            return replace(value, part=spoil(value.part, by))
        case Pose():
            return replace(value, T_part_scan=value.T_part_scan + by * np.eye(4, k=3))
        case Sites():
            return replace(value, label=np.roll(value.label, int(np.ceil(by * 1e6))))
        case Rims():
            return Rims(
                tuple(np.roll(loop, int(np.ceil(by * 1e6)))[: -1 if by > 0.1 else None] for loop in value.loops)
            )
        case Enclosures():
            return Enclosures(tuple(replace(item, solid=spoil(item.solid, by)) for item in value.items))
        case ExportedFiles() | ReportFiles():
            return replace(value, files=(*value.files, f"{by}.txt"))
        case DepositPath():
            return replace(value, points=value.points + by)
        case None:
            return Solid(*(getattr(_scene.make_box(np.zeros(3), np.full(3, by), 9), n) for n in ("vertices", "faces")))
        case _:
            return replace(value, distance=value.distance + by, label=value.label + np.uint8(by > 0.1))


def edit_input(result: Any, given: dict[str, Any]) -> Any:
    """Writes into an input, past the lock of its arrays."""
    value = next(v for v in given.values() if not isinstance(v, float | str | bool | Path))
    held = value if isinstance(value, np.ndarray) else next(iter(vars(value).values()))
    if isinstance(held, np.ndarray):
        array = held if held.flags.writeable else held.base
        array.setflags(write=True)
        array.flat[0] += 1
    else:
        object.__setattr__(value, next(iter(vars(value))), "edited")
    return result


MADE: dict[tuple[str, ...], Any] = {}
"""Results of the good implementations, by the inputs: the faults are added to them, and not to runs of their own."""


def make_good(base: Any, checks: Any, stage: Any, given: dict[str, Any]) -> Any:
    """What a good implementation gives; it is computed once for each of its inputs."""
    if base in (conformance.PartContract, conformance.ExportContract, conformance.ReportContract):
        return base.call(checks, stage, given)  # it reads or writes files
    data = pickle.dumps({name: to_bytes(value) for name, value in given.items()})
    key = (base.__name__, repr(stage), hashlib.sha256(data).hexdigest())
    if key not in MADE:
        MADE[key] = base.call(checks, stage, given)
    return MADE[key]


def make_checks(name: str, tmp_path: Path, fault: Fault) -> Any:
    """The checks of a contract on an implementation that has a fault."""
    stage, told = GOOD[name]
    base = getattr(conformance, f"{name}Contract")
    if name == "Part":
        write_stl(tmp_path / "prism.stl", _scene.make_prism())
        stage = PartFile(path=tmp_path / "prism.stl")

    def call(self: Any, stage: Any, given: dict[str, Any]) -> Any:
        return fault(make_good(base, self, stage, given), given)

    made = type("Case", (base,), {"stage": stage, "call": call, **told})()
    if name in ("Export", "Report"):
        (tmp_path / "home").mkdir()
        made.home, made.count = tmp_path / "home", 0
    return made


def test_there_is_one_good_for_every_class() -> None:
    every = {n.removesuffix("Contract") for n in conformance.__all__ if n.endswith("Contract")} - {"Stage"}
    assert GOOD.keys() == MEANING.keys() == every


@pytest.mark.variants(7)
@pytest.mark.parametrize("name", GOOD)
def test_a_wrong_type(name: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError):
        make_checks(name, tmp_path, lambda result, given: SimpleNamespace()).test_gives_its_type()


@pytest.mark.parametrize(
    "name", [*sorted(GOOD.keys() - {"Part", "Path"}), pytest.param("Path", marks=pytest.mark.slow)]
)
def test_an_edited_input(name: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError):
        make_checks(name, tmp_path, edit_input).test_leaves_its_inputs()


def test_an_edited_file(tmp_path: Path) -> None:
    def appended(result: Any, given: dict[str, Any]) -> Any:
        (tmp_path / "prism.stl").write_bytes(b"solid")
        return result

    with pytest.raises(AssertionError):
        make_checks("Part", tmp_path, appended).test_leaves_its_inputs()


@pytest.mark.parametrize("name", GOOD)
def test_chance(name: str, tmp_path: Path) -> None:
    np.random.seed(1)  # noqa: NPY002
    made = make_checks(name, tmp_path, lambda result, given: spoil(result, 1e-5 * np.random.random()))  # noqa: NPY002
    with pytest.raises(AssertionError, match=r"the second run (gave|wrote) other bytes|a job refuses this result"):
        made.test_same_bytes_twice()


@pytest.mark.parametrize("name", PLACED)
def test_a_length_of_its_own(name: str, tmp_path: Path) -> None:
    made: Any = make_checks(name, tmp_path, lambda result, given: spoil(result, 1.0))
    if name == "Cluster":
        made = type("Case", (conformance.ClusterContract,), {"stage": Dbscan(eps=0.5)})()
    for check in (lambda: made.test_no_length_of_its_own(1e-3), lambda: made.test_no_length_of_its_own(1e3)):
        try:
            check()
        except AssertionError:
            return
    pytest.fail("a length of 1 went unnoticed")


@pytest.mark.parametrize("name", GOOD)
def test_a_wrong_result(name: str, tmp_path: Path) -> None:
    by = -3.0 if name in ("Background", "Sample") else 3.0
    made = make_checks(name, tmp_path, lambda result, given: spoil(result, by))
    if name == "Allowance":
        made = make_checks(name, tmp_path, lambda result, given: spoil(given["damage"], -0.5))
    with pytest.raises(AssertionError):
        getattr(made, MEANING[name])()


@pytest.mark.parametrize("name", BAD_INPUT)
@pytest.mark.parametrize("kind", [ValueError, IndexError])
def test_a_crash_on_bad_input(name: str, kind: type[Exception], tmp_path: Path) -> None:
    def call(stage: Any, given: dict[str, Any]) -> Any:
        raise kind("zero-size array")

    made = make_checks(name, tmp_path, lambda result, given: result)
    made.call = call
    check, arguments = BAD_INPUT[name]
    with pytest.raises(kind, match="zero-size"):
        getattr(made, check)(*arguments)


UNFIT: dict[str, Callable[[Any], Any]] = {
    "Sample": lambda value: replace(value, face=value.face + 10**6),
    "Segment": lambda value: replace(value, face=value.face + 10**6),
    "Cluster": lambda value: Sites(value.label[1:], value.count),
    "Boundary": lambda value: Rims(tuple(loop[::2] for loop in value.loops)),
    "Boolean": lambda value: spoil(value, 3.0),
    "Export": lambda value: replace(value, files=(*value.files, "../elsewhere.txt")),
    "Report": lambda value: replace(value, files=("missing.html",)),
}


@pytest.mark.parametrize("name", UNFIT)
def test_a_result_that_does_not_fit_its_inputs(name: str, tmp_path: Path) -> None:
    made = make_checks(name, tmp_path, lambda result, given: UNFIT[name](result))
    with pytest.raises(AssertionError, match="a job refuses this result"):
        made.test_fits_its_inputs()


def test_a_crash_on_a_broken_file(tmp_path: Path) -> None:
    made = make_checks("Part", tmp_path, lambda result, given: result)
    made.call = lambda stage, given: stage.path.read_bytes()[99]
    with pytest.raises(IndexError):
        made.test_refuses_a_broken_file("empty", tmp_path)


def test_a_check_that_is_no_check_cannot_be_excepted(tmp_path: Path) -> None:
    made = make_checks("Boolean", tmp_path, lambda result, given: result)
    made.exceptions = {"test_of_nothing": "because"}
    with pytest.raises(AssertionError, match="exceptions must name checks"):
        StageContract.test_declares_itself(made)


class Fixture(KnownPose):
    """A pose that a fixture gives, by the name of a stranger; it does not say that it is known."""

    use: Literal["fixture"] = "fixture"  # type: ignore[assignment]
    gives_fitted_pose: ClassVar[bool] = True


class InOneProcess(NoRepair):
    """Works with what only this process has."""

    use: Literal["here"] = "here"  # type: ignore[assignment]
    isolated: ClassVar[bool] = True

    def run(self, enclosure: Mesh) -> Solid:
        if os.getpid() != HERE:
            raise RuntimeError("no licence in this process")
        return Solid(enclosure.vertices, enclosure.faces)


HERE = 0
"""The process of the tests, once it is set there alone."""


def test_a_known_pose_that_does_not_say_so_is_caught() -> None:
    case = type("Case", (conformance.AlignContract,), {"stage": Fixture(), "pose": np.eye(4), "_results": {}})
    with pytest.raises(AssertionError, match="gives_fitted_pose is True, but the pose stays"):
        case().test_says_whether_the_pose_is_fitted()


def test_a_stage_that_works_in_the_engines_process_alone_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "HERE", os.getpid())
    case = type("Case", (conformance.RepairContract,), {"stage": InOneProcess(), "_results": {}})
    case().test_gives_its_type()
    with pytest.raises(RuntimeError, match="no licence in this process"):
        case().test_runs_in_a_process_of_its_own()
