"""A spline over a plane: it follows a height field, and its plane faces all of it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from damageest.artefacts import Mesh
from damageest.geometry.height_spline import DEGREE, fit_height_plane, fit_height_spline


def wave(count: int = 40) -> Mesh:
    """A wavy height field over a tilted plane."""
    x, y = np.meshgrid(np.linspace(0, 4, count), np.linspace(0, 2, count), indexing="ij")
    number = np.arange(count * count).reshape(count, count)
    a, b, c, d = (n.ravel() for n in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Mesh(np.column_stack([x.ravel(), y.ravel(), (0.2 * np.sin(x) * np.cos(y)).ravel()]), faces)


def test_spline_follows_the_surface() -> None:
    points = wave().vertices
    knots, poles = fit_height_spline(points, 16)
    heights = NdBSpline(knots, poles[..., 2], DEGREE)(points[:, :2])
    assert np.abs(heights - points[:, 2]).max() < 1e-3


def test_it_goes_on_smoothly_beyond_the_points() -> None:
    flat = np.column_stack([wave().vertices[:, :2], 3 + 0.5 * wave().vertices[:, 0]])
    knots, poles = fit_height_spline(flat, 8, margin=0.2)
    beyond = np.array([[-0.6, 1.0], [4.6, 1.0]])
    assert NdBSpline(knots, poles[..., 2], DEGREE)(beyond) == pytest.approx(3 + 0.5 * beyond[:, 0], abs=1e-3)


def test_plane_faces_all_of_a_height_field() -> None:
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    mesh = wave()
    axes, overhang = fit_height_plane(Mesh(mesh.vertices @ turn.T, mesh.faces))
    assert overhang == 0
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-9)
    assert abs(axes[2] @ turn[:, 2]) > 0.95
