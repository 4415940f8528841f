"""The job file: both spellings, defaults, and faults that say where and what."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.errors import InputError, JobError
from damageest.job import load, yamlfile
from damageest.pipeline.placing.prepare import inspect_inputs, read_inputs
from damageest.registry import Registry
from damageest.registry.contracts import DEFAULTS
from damageest.stages.cluster import Cluster
from damageest.stages.enclose import Enclose, EncloseAll
from damageest.stages.part import ReadPart
from damageest.stages.reconstruct import Reconstruct
from damageest.stages.scan import ReadScan

JobFile = Callable[..., Path]


def faults(path: Path, registry: Registry, *sets: str) -> list[str]:
    with pytest.raises(JobError) as caught:
        load(path, registry, sets)
    assert caught.value.exit_status == 2
    return caught.value.lines()


def test_version_part_and_scan_suffice(job_file: JobFile, registry: Registry) -> None:
    job = load(job_file(), registry)
    assert {c: s.use for c, s in job.stages.items()} == DEFAULTS
    assert (job.name, job.units, job.tolerance, job.method) == ("job", "mm", None, "auto")
    assert job.output == job_file().parent / "out" / "job"


def test_both_spellings_mean_the_same(job_file: JobFile, registry: Registry) -> None:
    bare = load(job_file("cluster: dbscan\n"), registry)
    mapping = load(job_file("cluster: {use: dbscan}\n"), registry)
    without_use = load(job_file("cluster: {neighbours: 12}\n"), registry)
    assert bare.stages == mapping.stages
    assert without_use.stages[Cluster].model_dump()["neighbours"] == 12
    long = load(job_file("", head="version: 1\npart: {use: file, path: box.stl}\nscan: [scan.xyz]\n"), registry)
    assert long.stages[ReadPart] == bare.stages[ReadPart]


def test_yaml_1_2_numbers_and_words(job_file: JobFile, registry: Registry) -> None:
    assert load(job_file("tolerance: 1e-3\n"), registry).tolerance == 0.001
    assert load(job_file("name: no\n"), registry).name == "no"


def test_options_without_a_name_are_the_routes_own(job_file: JobFile, registry: Registry) -> None:
    assert EncloseAll in load(job_file("enclose: {point_weight: 2}\n"), registry).stages
    surface = load(job_file("method: surface\nenclose: {overhang: 2}\n"), registry)
    assert surface.stages[Enclose].use == "divide"
    assert load(job_file("boundary: all_loops\nenclose: {overhang: 2}\n"), registry).method == "surface"
    octree = load(job_file("method: octree\nenclose: {depth: 7}\n"), registry)
    assert octree.stages[EncloseAll].model_dump()["depth"] == 7


def test_naming_a_surface_stage_chooses_that_route(job_file: JobFile, registry: Registry) -> None:
    assert load(job_file("reconstruct: pyvista\n"), registry).method == "surface"
    implicit = load(job_file("method: implicit\n"), registry)
    assert Reconstruct not in implicit.stages
    assert EncloseAll in implicit.stages


def test_octree_is_a_route_of_its_own(job_file: JobFile, registry: Registry) -> None:
    by_route = load(job_file("method: octree\n"), registry)
    by_stage = load(job_file("enclose: octree\n"), registry)
    set_from_outside = load(job_file(""), registry, ["method=octree", "enclose.cell=0.4"])
    for job in (by_route, by_stage, set_from_outside):
        assert (job.method, job.stages[EncloseAll].use) == ("octree", "octree")
        assert Reconstruct not in job.stages
    assert set_from_outside.stages[EncloseAll].model_dump()["cell"] == 0.4


CASES = {
    "clutser: dbscan": (":4:1", "did you mean 'cluster'?"),
    "cluster: dbscam": (":4:1", "did you mean 'dbscan'?"),
    "cluster:\n  use: dbscan\n  neighbors: 5": (":6:3", "did you mean 'neighbours'?"),
    "cluster: {neighbours: -3}": (":4:11", "neighbours"),
    "cluster: 7": (":4:1", "use: <name>"),
    "cluster:": (":4:1", "use: <name>"),
    "tolerance: -1": (":4:1", "greater than 0"),
    "tolerance: .nan": (":4:1", "tolerance"),
    "tolerance: thin": (":4:1", "tolerance"),
    "units: parsec": (":4:1", "'mm'"),
    "method: implcit": (":4:1", "did you mean 'implicit'?"),
    "method: implicit\nreconstruct: pyvista": (":5:1", "not a stage of"),
    "method: surface\nenclose: implicit": (":5:1", "method: implicit"),
    "method: surface\nenclose: octree": (":5:1", "method: octree"),
    "method: implicit\nenclose: octree": (":5:1", "method: octree"),
    "method: octree\nenclose: implicit": (":5:1", "method: implicit"),
    "method: octree\nboundary: all_loops": (":5:1", "not a stage of"),
    "method: octree\nenclose: {deph: 7}": (":5:11", "did you mean 'depth'?"),
    "method: octree\nenclose: {depth: 7, cell: 1}": (":5:", "give one of them"),
    "name: a/b": (":4:1", "name"),
    "version: 1": (":4:1", "duplicate key"),
    "cluster: [": (":5:1", "not valid YAML"),
    "cluster: {use: dbscan": (":5:1", "not valid YAML"),
}


@pytest.mark.parametrize("body", CASES)
def test_faults_name_place_and_remedy(body: str, job_file: JobFile, registry: Registry) -> None:
    place, text = CASES[body]
    path = job_file(body + "\n")
    lines = faults(path, registry)
    assert len(lines) == 1
    assert lines[0].startswith(f"{path}{place}")
    assert text in lines[0]


def test_every_fault_is_named_in_one_go(job_file: JobFile, registry: Registry) -> None:
    lines = faults(job_file("clutser: x\nsegment: y\nunits: z\n"), registry)
    assert [line.split(":")[1] for line in lines] == ["4", "5", "6"]


@pytest.mark.parametrize(
    ("head", "text"),
    [
        ("part: box.stl\nscan: scan.xyz\n", "version: 1"),
        ("version: 2\npart: box.stl\nscan: scan.xyz\n", "expected 1"),
        ("version: 1\nscan: scan.xyz\n", "part: path/to/file"),
        ("version: 1\npart: box.stl\n", "scan: path/to/file"),
        ("version: 1\npart: bix.stl\nscan: scan.xyz\n", "no such file"),
        ("version: 1\npart: box.doc\nscan: scan.xyz\n", "no reader for '.doc'"),
        ("version: 1\npart: .\nscan: scan.xyz\n", "no reader for"),
        ("- 1\n- 2\n", "a job is a mapping"),
        ("", "a job is a mapping"),
    ],
)
def test_heads_at_fault(head: str, text: str, job_file: JobFile, registry: Registry) -> None:
    assert text in "\n".join(faults(job_file("", head=head), registry))


def test_settings_override_the_file(job_file: JobFile, registry: Registry) -> None:
    job = load(job_file("cluster: dbscan\n"), registry, ["cluster.neighbours=15", "tolerance=0.5", "method=surface"])
    assert job.stages[Cluster].model_dump()["neighbours"] == 15
    assert (job.tolerance, job.method) == (0.5, "surface")
    assert "did you mean 'cluster'?" in faults(job_file(), registry, "clutser.eps=1")[0]
    assert "stage.option=value" in faults(job_file(), registry, "cluster.eps")[0]


def test_written_job_gives_the_same_job(job_file: JobFile, registry: Registry, tmp_path: Path) -> None:
    first = load(job_file("cluster: {neighbours: 12}\ntolerance: 0.25\n"), registry)
    again = tmp_path / "deep" / "job.yaml"
    again.parent.mkdir()
    again.write_text(yamlfile.write(first.to_values(again.parent)))
    second = load(again, registry)
    assert second.stages == first.stages
    assert second.tolerance == first.tolerance


@settings(max_examples=60, deadline=None)
@given(st.text(alphabet=st.characters(codec="utf-8"), max_size=60))
def test_any_text_gives_a_job_error_and_nothing_else(text: str) -> None:
    with contextlib.suppress(JobError):
        yamlfile.parse(text, "text")


_WORDS = st.text(alphabet=st.characters(categories=["L", "N", "P", "S", "Zs"]), max_size=8)
_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | _WORDS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(_WORDS, inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=60, deadline=None)
@given(tree=st.dictionaries(st.sampled_from(["version", "part", "scan", "cluster", "method"]), _VALUES, max_size=5))
def test_any_mapping_is_sound_or_a_job_error(tree: dict[str, object], registry: Registry) -> None:
    with contextlib.suppress(JobError):
        load(tree, registry)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(_VALUES)
def test_written_yaml_reads_back_the_same(value: object) -> None:
    again, _ = yamlfile.parse(yamlfile.write({"v": value}), "text")
    assert repr(again["v"]) == repr(value)


HEAD = "version: 1\npart: box.stl\n"


def test_a_file_may_say_where_its_scanner_stood(job_file: JobFile, registry: Registry) -> None:
    items = "[{path: scan.xyz, viewpoint: [1, 2, 3]}, scan.xyz]"
    bare, spelled = (
        load(job_file("", head=f"{HEAD}scan: {text}\n"), registry) for text in (items, f"{{use: file, path: {items}}}")
    )
    assert bare.stages[ReadScan] == spelled.stages[ReadScan]
    again = bare.to_values(job_file().parent)
    assert load(job_file("", head=yamlfile.write(again)), registry).stages[ReadScan] == bare.stages[ReadScan]
    single = load(job_file("", head=f"{HEAD}scan: {{path: scan.xyz, viewpoint: [1, 2, 3]}}\n"), registry)
    assert single.stages[ReadScan].model_dump()["viewpoint"] == (1, 2, 3)


@pytest.mark.parametrize(
    ("scan", "says"),
    [
        (
            "\n  - {path: scan.xyz, viewpoint: [1, 2]}",
            "4:22: scan.path.0.viewpoint.2: the list is too short: value 3 is",
        ),
        ("\n  - scan.xyz\n  - {path: scan.xyz, viewpoin: [1, 2, 3]}", "5:22: scan.path.1.viewpoin: unknown option"),
        ("\n  - scan.xyz\n  - {viewpoint: [1, 2, 3]}", "5:5: scan.path.1.path: missing: give  path: ..."),
        ("\n  - {viewpoint: [1, 2, 3]}", "4:5: scan.path.0.path: missing: give  path: ..."),
        ("\n  - scan.xyz\n  - 7", "5:5: scan.path.1: expected the path of a file, not 7"),
        ("\n  - scan.xyz\n  - {path: gone.xyz}", "5:6: scan.path.1.path: "),
        (" []", "3:1: scan.path: the list of files is empty"),
        (" {path: [scan.xyz], viewpoint: [1, 2, 3]}", "viewpoint: is for a single file"),
        (" {path: scan.xyz, viewpoint: 7}", "3:24: scan.viewpoint: expected a list, not 7"),
        (" {path: scan.xyz, crop: [{keep: sphere}]}", "3:31: scan.crop.0: give  keep: box"),
        (" {path: scan.xyz, crop: [{keep: above}]}", "3:31: scan.crop.0: missing: give  point"),
    ],
)
def test_faults_of_scans_are_told_where_they_are(scan: str, says: str, job_file: JobFile, registry: Registry) -> None:
    told = faults(job_file("", head=f"{HEAD}scan:{scan}\n"), registry)
    assert len(told) == 1
    assert says in told[0]


@pytest.mark.parametrize("scan", ["{use: simulate, points: 4000, noise: 0", "{path: scan.xyz"])
def test_crops_belong_to_every_reader(scan: str, job_file: JobFile, registry: Registry) -> None:
    """The note says what was removed; the points above the plane are gone."""
    whole_job = load(job_file("", head=f"{HEAD}scan: {scan}}}\n"), registry)
    job = load(job_file("", head=f"{HEAD}scan: {scan}, crop: [{{drop: above, point: [0, 0, 0.1]}}]}}\n"), registry)
    (_, whole), (_, left) = read_inputs(whole_job, registry), read_inputs(job, registry)
    assert whole.points[:, 2].max() >= 0.1 > left.points[:, 2].max()
    assert left.notes[-1].startswith("crop 1 (drop above): removed")
    job = load(job_file("", head=f"{HEAD}scan: {scan}, crop: [{{keep: above, point: [0, 0, 1e6]}}]}}\n"), registry)
    with pytest.raises(InputError, match=r"crop 1 \(keep above\) leaves no points"):
        read_inputs(job, registry)


def test_a_part_of_doubtful_size_is_named(job_file: JobFile, registry: Registry) -> None:
    """Part and scan in metres, in a job in millimetres: only their size shows it."""
    head = "version: 1\npart: {path: box.stl, unit: um}\nscan: {use: simulate, points: 4000}\n"
    doubts = inspect_inputs(load(job_file("", head=head), registry), registry)[3]
    assert any("the part is 0.04 mm across; is `units: mm` right?" in doubt.text for doubt in doubts)
    head = head.replace("unit: um", "unit: mm")
    doubts = inspect_inputs(load(job_file("", head=head), registry), registry)[3]
    assert "unit" not in [doubt.code for doubt in doubts]
