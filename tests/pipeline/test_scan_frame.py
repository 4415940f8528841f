"""Files in the scan's frame lie where the scanner saw the part, whatever was corrected; so does the transform."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold
from scipy.spatial.transform import Rotation

import damageest
from damageest.artefacts import Floats, Mesh
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.io.meshes import write_points
from tests import damaged_box

NOISE, TOLERANCE, FAR = 0.01, 0.2, np.array([1000.0, -700.0, 400.0])
HOT = {"part": 220, "expansion": 24e-6}
FACTOR = 1 + 200 * 24e-6
TURN = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()


NEAR = np.eye(4)
NEAR[:3, :3], NEAR[:3, 3] = TURN.T, -TURN.T @ FAR
KNOWN = {"use": "none", "T_part_scan": NEAR.tolist()}


def place(points: Floats) -> Floats:
    """Points in the frame of a scanner whose origin is 1.3 m away."""
    return np.asarray(points @ TURN.T + FAR)


def inch(folder: Path) -> dict[str, str]:
    return {"use": "file", "path": str(folder / "raw.ply"), "unit": "in"}


def sample_damaged(count: int = 6000) -> Floats:
    """Points of the box with half a ball lost, in the part's frame."""
    body = to_manifold(damaged_box.box()) - Manifold.sphere(6, 64).translate((5, 2, 10))
    mesh = trimesh.Trimesh(*to_arrays(body), process=False)
    points, face = trimesh.sample.sample_surface(mesh, count, seed=0)
    away = np.random.default_rng(0).normal(0, NOISE, count)
    return np.asarray(points + away[:, None] * mesh.face_normals[face])


def run(folder: Path, raw: Floats, unit: float = 1.0, **more: Any) -> dict[str, Any]:
    """Runs the box with points as a scanner gave them; gives result.json. ``unit``: of the file, in mm."""
    job = {"version": 1, "tolerance": TOLERANCE, "report": "none", "adapt": "none", "accept": "all", "align": KNOWN,
           "scan": write(folder / "raw.ply", raw), "export": {"format": "ply", "frame": "both"}, **more}  # fmt: skip
    damageest.run(job, part=damaged_box.box(), output=folder / "out")
    content: dict[str, Any] = json.loads((folder / "out/result.json").read_text())
    raw = unit * raw
    written = trimesh.load(folder / "out/scan_frame/scan.ply").vertices
    assert np.allclose(np.asarray(written), raw, rtol=0, atol=2e-4)
    check_fit(raw, read(folder / "out/scan_frame/undamaged.ply"))
    # the same by the transform
    T, rescaled = np.array(content["alignment"]["transform"]), content["alignment"].get("rescaled")
    if rescaled:
        centre = np.array(rescaled["centre"])
        raw = centre + (raw - centre) / rescaled["factor"]
    check_fit(raw @ T[:3, :3].T + T[:3, 3], read(folder / "out/undamaged.ply"))
    return content


def write(path: Path, raw: Floats) -> str:
    x, y, z = raw.T
    write_points(path, {"x": x, "y": y, "z": z})
    return str(path)


def read(path: Path) -> Mesh:
    mesh = trimesh.load(path, process=False)
    return Mesh(np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64))


def check_fit(points: Floats, mesh: Mesh) -> None:
    """Points lie on the mesh, but for noise; those on the damage surface less exactly."""
    distance = distance_to_mesh(points, mesh)
    assert np.quantile(distance, 0.9) < 4 * NOISE
    assert distance.max() < 2 * TOLERANCE


@pytest.mark.slow
def test_without_a_correction_the_transform_is_all(tmp_path: Path) -> None:
    assert "rescaled" not in run(tmp_path, place(sample_damaged()))["alignment"]


@pytest.mark.slow
def test_temperature(tmp_path: Path) -> None:
    content = run(tmp_path, place(FACTOR * sample_damaged()), temperature=HOT)
    assert content["alignment"]["rescaled"]["factor"] == pytest.approx(FACTOR, abs=1e-12)
    # the rigid transform alone puts the part where it is, but for the expansion of half of it
    T = np.array(content["alignment"]["transform"])
    assert np.linalg.norm(T[:3, :3] @ FAR + T[:3, 3]) < 0.02
    volume = content["damage_volume"]
    assert volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.05)
    assert trimesh.load(tmp_path / "out/scan_frame/damage.ply").volume == pytest.approx(volume * FACTOR**3, rel=1e-3)


@pytest.mark.slow
def test_unit(tmp_path: Path) -> None:
    content = run(tmp_path, place(sample_damaged()) / 25.4, 25.4, scan=inch(tmp_path))
    assert "rescaled" not in content["alignment"]


@pytest.mark.slow
@pytest.mark.parametrize("temperature", [None, HOT])
def test_scale(tmp_path: Path, temperature: dict[str, float] | None) -> None:
    """Also where the temperature was corrected before: one factor about one place."""
    scan = {"use": "file", "path": str(tmp_path / "raw.ply"), "scale": "auto"}
    warm = FACTOR if temperature else 1.0
    more = {"temperature": temperature} if temperature else {}
    content = run(tmp_path, place(1.01 * warm * sample_damaged(30_000)), scan=scan, align="register", **more)
    assert content["alignment"]["rescaled"]["factor"] == pytest.approx(1.01 * warm, rel=1e-3)


@pytest.mark.slow
def test_adapt(tmp_path: Path) -> None:
    """The adapted part lies on the points that it was adapted to."""
    points = sample_damaged(30_000)
    points[:, 2] += 0.8 * (points[:, 0] / 20) ** 2
    content = run(tmp_path, place(points), adapt="smooth", align="register")
    assert content["adapt"] is not None


@pytest.mark.slow
def test_views(tmp_path: Path) -> None:
    """A view that is put right is moved in the part's frame; the scan's frame keeps it where the scanner had it."""
    points = sample_damaged(30_000)
    one = points[:, 0] < 6
    other = points[:, 0] > -6
    moved = points[other] + (0.0, 0.35, 0.0)
    paths = [write(tmp_path / f"{k}.ply", place(some)) for k, some in enumerate((points[one], moved))]
    align = {"use": "register", "fit_views": True}
    job = {"version": 1, "tolerance": TOLERANCE, "report": "none", "adapt": "none", "accept": "all", "align": align,
           "scan": {"use": "file", "path": paths}, "export": {"format": "ply", "frame": "scan"}}  # fmt: skip
    damageest.run(job, part=damaged_box.box(), output=tmp_path / "out")
    raw = np.concatenate([place(points[one]), place(moved)])
    written = np.asarray(trimesh.load(tmp_path / "out/scan_frame/scan.ply").vertices)
    assert np.allclose(written, raw, rtol=0, atol=2e-4)
    distance = distance_to_mesh(raw, read(tmp_path / "out/scan_frame/undamaged.ply"))
    assert np.quantile(distance, 0.9) < 0.35 + 4 * NOISE
