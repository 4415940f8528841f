"""The files of a result: read back, they hold what the result holds."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Deviation, Pose, Scan, Solid, Surface, Truth
from damageest.geometry.make_part import make_part
from damageest.io.meshes import read_mesh
from damageest.registry import Registry
from damageest.stages.export.files import Files


def write(result, folder, **options):
    """The names of the files that a result becomes."""
    return Files.model_validate(options).run(result, folder, Registry.discover().writers).files


def sphere(radius=5.0, at=(0.0, 0, 0), subdivisions=3):
    mesh = trimesh.creation.icosphere(subdivisions, radius=radius)
    return Solid(mesh.vertices + np.asarray(at), mesh.faces)


@pytest.fixture
def result():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(200, 3)) * 40
    body = sphere(3)
    flat = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]) / 3, np.array([[0, 1, 2]]))
    sites = (
        SimpleNamespace(id=1, damage=body, surface=flat, deposit=sphere(3.5), accepted=True, path=None),
        SimpleNamespace(id=2, damage=sphere(2, (20, 0, 0)), surface=flat, deposit=None, accepted=True, path=None),
    )
    return SimpleNamespace(
        units="mm",
        tolerance=0.1,
        pose=Pose(np.eye(4)),
        transform_to_scan=np.eye(4),
        raw_points=points,
        adapted=None,
        scan=Scan(points, truth=Truth(body, np.eye(4))),
        aligned=Scan(points),
        deviation=Deviation(rng.normal(size=200), np.zeros(200, int), rng.integers(0, 4, 200)),
        site_label=rng.integers(0, 3, 200).astype(np.int32),
        sites=sites,
        damage=body,
        undamaged=sphere(9),
        surplus=(),
        coverage=None,
    )


def test_every_file_is_there_and_named(result, tmp_path):
    files = write(result, tmp_path)
    on_disk = {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()}
    assert (
        set(files)
        == on_disk
        == {
            *("damage.stl", "undamaged.stl", "scan.ply", "truth/damage.stl", "truth/pose.json"),
            *(
                "damage/site-1.stl",
                "damage/site-2.stl",
                "surface/site-1.ply",
                "surface/site-2.ply",
                "deposit/site-1.stl",
            ),
        }
    )
    assert json.loads((tmp_path / "truth/pose.json").read_text())["T_part_scan"] == np.eye(4).tolist()


def test_a_result_without_damage_has_no_damage_file(result, tmp_path):
    result.damage, result.sites, result.scan = None, (), Scan(result.scan.points)
    assert set(write(result, tmp_path)) == {"undamaged.stl", "scan.ply"}


def test_ply_keeps_every_digit(result, tmp_path):
    files = write(result, tmp_path, format="ply")
    assert not any(name.endswith(".stl") for name in files)
    vertices, faces, _ = read_mesh(tmp_path / "damage/site-2.ply")
    np.testing.assert_array_equal(vertices, result.sites[1].damage.vertices)
    np.testing.assert_array_equal(faces, result.sites[1].damage.faces)


def test_stl_reads_back_watertight(result, tmp_path):
    write(result, tmp_path)
    for path in tmp_path.rglob("*.stl"):
        mesh = trimesh.load_mesh(path)
        assert mesh.is_watertight, path
        assert mesh.is_winding_consistent
    assert trimesh.load_mesh(tmp_path / "undamaged.stl").volume == pytest.approx(result.undamaged.volume, rel=1e-5)


def test_the_scan_has_distance_label_and_site_per_point(result, tmp_path):
    write(result, tmp_path)
    data = trimesh.load(tmp_path / "scan.ply").metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(np.column_stack([data[a] for a in "xyz"]), result.aligned.points)
    np.testing.assert_array_equal(data["label"], result.deviation.label)
    np.testing.assert_array_equal(data["site"], result.site_label)
    np.testing.assert_allclose(data["distance"], result.deviation.distance, rtol=1e-6)


def test_the_same_result_gives_the_same_bytes(result, tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write(result, tmp_path / name)
    for path in (tmp_path / "a").rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes()


def touching_cubes(at: float) -> Solid:
    """Two that share an edge, with vertices of their own."""
    other = trimesh.creation.box((2, 2, 2)).apply_translation((2, 2, 0))
    cubes = trimesh.util.concatenate([trimesh.creation.box((2, 2, 2)), other])
    return Solid(cubes.vertices + at, cubes.faces)


def test_a_solid_that_touches_itself_stays_closed(result, tmp_path):
    result.damage = touching_cubes(0)
    files = write(result, tmp_path)
    assert "damage.ply" not in files
    mesh = trimesh.load_mesh(tmp_path / "damage.stl")  # merges vertices
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(16, rel=1e-5)


def test_a_solid_that_single_precision_would_open_comes_as_ply_too(result, tmp_path):
    result.damage = touching_cubes(2e4)  # so far away that sheets cannot be moved apart without changing the volume
    files = write(result, tmp_path)
    assert {"damage.ply", "damage.stl"} <= set(files)
    vertices, faces, _ = read_mesh(tmp_path / "damage.ply")
    assert make_part(vertices, faces).volume == pytest.approx(16)
