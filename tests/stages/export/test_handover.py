"""Files for CAM and robot cell: 3MF that other programs read, several formats at once, the scan's frame, the pose."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from damageest.artefacts import Solid
from damageest.errors import JobError
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.geometry.units import MILLIMETRES
from damageest.job import load
from damageest.output.result_json import build_report
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.export._colours import DAMAGE, DEPOSIT, UNDAMAGED
from damageest.stages.export.files import Files
from tests.needs import import_or_skip
from tests.stages.export import results


def write(result: Result, folder: Path, registry: Registry, **options: Any) -> Any:
    folder.mkdir(exist_ok=True)
    return Files.model_validate(options).run(result, folder, registry.writers)


def opened(path: Path) -> tuple[str, dict[str, tuple[trimesh.Trimesh, str]]]:
    """By lib3mf: the unit in the model, and each item of the build by its name: mesh and colour."""
    model = import_or_skip("lib3mf").get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    assert reader.GetWarningCount() == 0
    found = {}
    items = model.GetBuildItems()
    while items.MoveNext():
        item = model.GetMeshObjectByID(items.GetCurrent().GetObjectResource().GetResourceID())
        assert item.IsManifoldAndOriented()
        vertices = [list(v.Coordinates) for v in item.GetVertices()]
        faces = [list(t.Indices) for t in item.GetTriangleIndices()]
        resource, number, has = item.GetObjectLevelProperty()
        assert has
        group = model.GetBaseMaterialGroupByID(resource)
        colour = group.GetDisplayColor(number)
        text = "#" + bytes((colour.Red, colour.Green, colour.Blue)).hex()
        assert group.GetName(number) == item.GetName()
        found[item.GetName()] = (trimesh.Trimesh(vertices, faces, process=False), text)
    return model.GetUnit().name, found


@pytest.mark.parametrize(
    ("units", "name"),
    [("um", "MicroMeter"), ("mm", "MilliMeter"), ("cm", "CentiMeter"), ("m", "Meter"), ("in", "Inch"), ("ft", "Foot")],
)
def test_lib3mf_and_trimesh_read_solids_names_colours_and_unit(
    units: str, name: str, tmp_path: Path, registry: Registry
) -> None:
    result = results.make(units, 1 / MILLIMETRES[units])  # the same part, whatever the unit
    written = write(result, tmp_path, registry, format="3mf")
    assert set(written.files) == {"result.3mf", "surface/site-1.ply", "surface/site-2.ply", "scan.ply"}
    first, second = result.sites
    assert result.undamaged is not None
    assert second.deposit is not None
    volumes = {
        "undamaged part": (result.undamaged.volume, UNDAMAGED),
        "damage site-1": (first.damage.volume, DAMAGE),
        "damage site-2": (second.damage.volume, DAMAGE),
        "deposit site-2": (second.deposit.volume, DEPOSIT),
    }
    unit, found = opened(tmp_path / "result.3mf")
    assert unit == name
    assert found.keys() == volumes.keys()
    scene = trimesh.load_scene(tmp_path / "result.3mf")
    assert scene.geometry.keys() == volumes.keys()
    assert scene.units in ("micron", "millimeter", "centimeter", "meter", "inch", "foot")
    scene = scene.convert_units("millimeters")
    for body, (volume, colour) in volumes.items():
        assert found[body][1] == "#" + bytes(colour).hex()
        assert found[body][0].volume == pytest.approx(volume, rel=1e-5)
        assert scene.geometry[body].is_watertight
        # the part is the same, so its volume in mm3 is that of the job in millimetres
        assert scene.geometry[body].volume == pytest.approx(volume * MILLIMETRES[units] ** 3, rel=1e-4)


def test_names_with_xml_characters(tmp_path: Path) -> None:
    from damageest.stages.export import Body
    from damageest.stages.export.threemf import write_threemf

    body = Body('<a & "b">', results.make().part, (1, 2, 3))
    write_threemf(tmp_path, "odd", [body], "mm")
    assert list(opened(tmp_path / "odd.3mf")[1]) == ['<a & "b">']


def test_formats_together_each_once_and_the_same_bytes_twice(tmp_path: Path, registry: Registry) -> None:
    result = results.make()
    for folder in (tmp_path / "a", tmp_path / "b"):
        written = write(result, folder, registry, format=["stl", "ply", "3mf", "stl"], frame="both")
    assert len(written.files) == len(set(written.files)) == 2 * (5 + 5 + 1 + 2 + 1)
    for name in written.files:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name


def test_the_scans_frame_holds_the_same_solids_where_the_scanner_saw_them(tmp_path: Path, registry: Registry) -> None:
    result = results.make()
    written = write(result, tmp_path, registry, format=["ply", "3mf"], frame="both")
    here = {name for name in written.files if not name.startswith("scan_frame/")}
    assert {f"scan_frame/{name}" for name in here} == set(written.files) - here
    T = result.pose.T_part_scan
    for name in sorted(here):
        if name.endswith(".3mf"):
            pairs = [
                (there, trimesh.load_scene(tmp_path / name).geometry[body])
                for body, there in trimesh.load_scene(tmp_path / "scan_frame" / name).geometry.items()
            ]
        else:
            pairs = [(trimesh.load(tmp_path / "scan_frame" / name), trimesh.load(tmp_path / name))]
        for there, part in pairs:
            back = trimesh.transform_points(there.vertices, T)
            np.testing.assert_allclose(back, part.vertices, atol=1e-9 if name.endswith(".ply") else 1e-4)
    points = trimesh.load(tmp_path / "scan_frame/scan.ply").vertices
    np.testing.assert_array_equal(points, result.scan.points)


def test_both_frames_hold_the_same_triangles(tmp_path: Path, registry: Registry) -> None:
    """Also where single precision makes points one in only one of the frames: some are 1e-6 of their place apart."""
    result = results.make()
    fine = to_manifold(result.sites[1].deposit).refine(3)
    points, faces = to_arrays(fine)
    rng = np.random.default_rng(2)
    near = rng.choice(len(points), 60, replace=False)
    ends = faces[np.array([np.flatnonzero((faces == k).any(axis=1))[0] for k in near])]
    other = ends[ends != near[:, None]].reshape(-1, 2)[:, 0]
    points[near] = points[other] + rng.normal(size=(60, 3)) * np.geomspace(1e-9, 3e-4, 60)[:, None]
    sites = (result.sites[0], replace(result.sites[1], deposit=Solid(points, faces)))
    write(replace(result, sites=sites), tmp_path, registry, format=["stl", "3mf"], frame="both")
    T = result.pose.T_part_scan
    for name in ("deposit/site-2.stl", "result.3mf"):
        part, there = (trimesh.load(tmp_path / place / name, process=False) for place in ("", "scan_frame"))
        if name == "result.3mf":
            part, there = (scene.geometry["deposit site-2"] for scene in (part, there))
            np.testing.assert_array_equal(part.faces, there.faces)
        np.testing.assert_allclose(trimesh.transform_points(there.triangles.reshape(-1, 3), T),
                                   part.triangles.reshape(-1, 3), atol=1e-4)  # fmt: skip
        for mesh in (part, there):
            mesh.merge_vertices()
            assert mesh.is_watertight


def test_the_scans_frame_alone(tmp_path: Path, registry: Registry) -> None:
    result = results.make()
    written = write(result, tmp_path, registry, frame="scan")
    assert {name.split("/")[0] for name in written.files} == {"scan_frame"}
    files = build_report(result, written)["sites"][1]["files"]
    assert files["damage"] == "scan_frame/damage/site-2.stl"
    assert files["deposit"] == "scan_frame/deposit/site-2.stl"


def test_result_json_lists_files_and_gives_the_pose_both_ways(tmp_path: Path, registry: Registry) -> None:
    result = results.make()
    written = write(result, tmp_path, registry, format=["stl", "ply"], frame="both")
    said = build_report(result, written)
    assert said["export"] == {"files": list(written.files), "notes": []}
    assert said["sites"][0]["files"]["damage"] == "damage/site-1.stl"
    assert len(said["sites"][0]["files"]["every"]) == 2 * 3
    w, *xyz = said["alignment"]["quaternion"]
    turn = Rotation.from_quat([*xyz, w]).as_matrix()
    T = np.array(said["alignment"]["transform"])
    np.testing.assert_allclose(turn, T[:3, :3], atol=1e-12)
    np.testing.assert_array_equal(said["alignment"]["translation"], T[:3, 3])
    assert w >= 0
    json.dumps(said, allow_nan=False)


def test_nothing_lost_and_nothing_left(tmp_path: Path, registry: Registry) -> None:
    result = results.without_damage()
    written = write(result, tmp_path, registry, format=["3mf", "stl"])
    assert set(written.files) == {"result.3mf", "undamaged.stl", "scan.ply"}
    assert list(opened(tmp_path / "result.3mf")[1]) == ["undamaged part"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "export: {format: stel}\n",
            r"job\.yaml:4:\d+: export\.format.*no format 'stel' \(did you mean 'ste?[lp]'\?\)",
        ),
        (
            "export: {format: [stl, obj]}\n",
            r"export\.format\.1: no format 'obj'; there are: 3mf, ply, (qif, )?(step, )?stl",
        ),
        ("export: {format: []}\n", r"export\.format: .*at least 1"),
        ("export: {format: 3}\n", r"export\.format"),
        (
            "export: {frame: robot}\n",
            r"export\.frame: expected 'part', 'scan', 'both', 'nominal' or 'all', not 'robot'",
        ),
    ],
)
def test_what_cannot_be_written_is_refused_with_the_job(
    text: str, said: str, job_file: Any, registry: Registry
) -> None:
    with pytest.raises(JobError, match=said):
        load(job_file(text), registry)


def test_a_format_of_a_plugin_that_is_not_there_names_it(job_file: Any, registry: Registry) -> None:
    from dataclasses import replace

    own = replace(registry, writers={name: w for name, w in registry.writers.items() if name != "step"})
    with pytest.raises(
        JobError, match=r"'step' needs the plugin damageest-cadquery.*(pip install|uv sync|apt-get install)"
    ):
        load(job_file("export: {format: [stl, step]}\n"), own)
    with pytest.raises(JobError, match="a spline needs the plugin damageest-cadquery"):
        load(job_file("export: {spline: true}\n"), own)


def test_one_name_and_a_list_are_written_out_alike(job_file: Any, registry: Registry, tmp_path: Path) -> None:
    for text in ("stl", "[stl]", "[stl, stl]"):
        job = load(job_file(f"export: {{format: {text}}}\n"), registry)
        assert job.to_values(tmp_path)["export"]["format"] == ["stl"]
