"""Inner damage surfaces as B-splines in STEP, read back by CadQuery: where the surface is, ending at its rim."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from damageest_cadquery.writing.patch import write_patch

from damageest.artefacts import Surface
from damageest.geometry.units import MILLIMETRES
from damageest.stages.export import Patch
from damageest.stages.export._spline import fit_spline
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def bowl(count: int = 60, hole: float = 0.0, noise: float = 0.0) -> Surface:
    """A shallow, wavy bowl of radius 5 about its own axis, turned; with a hole of a radius in its middle."""
    r, a = np.linspace(hole, 5, count), np.linspace(0, 2 * np.pi, 2 * count, endpoint=False)
    radius, angle = (x.ravel() for x in np.meshgrid(r, a, indexing="ij"))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    z = 0.08 * radius**2 + 0.2 * np.sin(x) + noise * np.random.default_rng(3).normal(size=len(x))
    ring = np.arange(2 * count)
    faces = []
    for k in range(count - 1):
        p, q = k * 2 * count + ring, k * 2 * count + np.roll(ring, -1)
        faces += [np.column_stack([p, p + 2 * count, q]), np.column_stack([q, p + 2 * count, q + 2 * count])]
    found = np.concatenate(faces)
    if not hole:  # the innermost ring is one point
        found = np.where(found < 2 * count, 0, found)
        found = found[(found[:, 0] != found[:, 1]) & (found[:, 1] != found[:, 2]) & (found[:, 2] != found[:, 0])]
    return Surface(np.column_stack([x, y, z]) @ TURN.T + [30, -20, 10], found)


def patch_of(surface: Surface, tolerance: float) -> Patch:
    patch, said = fit_spline(surface, tolerance)
    assert patch is not None, said.reason
    assert said.reason == ""
    assert said.deviation is not None
    assert said.deviation <= tolerance
    return patch


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hole", "unit"),
    [(1.5, "mm"), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((0.0, "mm"), (0.0, "in"), (1.5, "um")))],
)
def test_the_face_is_where_the_surface_is(hole: float, unit: str, tmp_path: Path) -> None:
    surface = bowl(hole=hole)
    patch = patch_of(surface, 0.05)
    assert len(patch.rims) == (2 if hole else 1)
    write_patch(tmp_path / "a.step", "damage surface", patch, unit)
    first = (tmp_path / "a.step").read_bytes()
    write_patch(tmp_path / "a.step", "damage surface", patch, unit)
    assert (tmp_path / "a.step").read_bytes() == first
    assert b"B_SPLINE_SURFACE" in first
    (face,) = cq.importers.importStep(str(tmp_path / "a.step")).faces().vals()
    scale = MILLIMETRES[unit]
    assert face.isValid()
    assert face.Area() / scale**2 == pytest.approx(surface.area, rel=0.01)
    some = np.random.default_rng(0).choice(len(surface.vertices), 40, replace=False)
    far = [face.distance(cq.Vertex.makeVertex(*(surface.vertices[k] * scale).tolist())) / scale for k in some]
    assert max(far) <= 0.05
    corners = np.array([corner.toTuple() for corner in face.tessellate(0.02 * scale)[0]]) / scale
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], surface.bounds, atol=0.1)


@pytest.mark.slow
def test_noise_is_smoothed_within_the_tolerance() -> None:
    patch, said = fit_spline(bowl(noise=0.01), 0.1)
    assert patch is not None
    assert said.deviation is not None
    assert said.deviation < 0.06
    assert patch.poles.shape[0] < 30, "a coarse one does"


@pytest.mark.slow
def test_the_deviation_is_the_true_one_both_ways() -> None:
    """Of a spline that was fitted to too little: the dent of 0.5 that the fit was not shown is its deviation."""
    from damageest.geometry import height_spline
    from damageest.stages.export import _spline

    surface = bowl()
    axes, _ = height_spline.fit_height_plane(surface)
    origin = surface.bounds.mean(axis=0)
    points = (surface.vertices - origin) @ axes.T
    knots, poles = height_spline.fit_height_spline(points, 16)
    near = _spline._measure_deviation(points, surface, knots, poles)
    dented = points.copy()
    dented[np.linalg.norm(points[:, :2] - points[:, :2].mean(0), axis=1) < 1, 2] -= 0.5
    assert near < 0.02
    assert _spline._measure_deviation(dented, surface, knots, poles) == pytest.approx(0.5, abs=0.03)


@pytest.mark.slow
def test_what_is_no_height_field_or_too_sharp_says_so() -> None:
    import trimesh

    ball = trimesh.creation.icosphere(4, radius=5)
    kept = ball.triangles_center[:, 2] < 3.5
    patch, said = fit_spline(Surface(ball.vertices, ball.faces[kept]), 0.1)
    assert patch is None
    assert "no height field over any plane" in said.reason
    assert said.deviation is None
    grid = np.stack(np.meshgrid(np.linspace(0, 10, 50), np.linspace(0, 10, 50), indexing="ij"), -1).reshape(-1, 2)
    number = np.arange(2500).reshape(50, 50)
    a, b, c, d = (x.ravel() for x in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    step = Surface(np.column_stack([grid, np.where(grid[:, 0] + 0.3 * grid[:, 1] > 6, 4.0, 0.0)]), faces)
    patch, said = fit_spline(step, 0.02)
    assert patch is None
    assert said.deviation is not None
    assert said.deviation > 0.02
    assert "more than" in said.reason or "off" in said.reason
