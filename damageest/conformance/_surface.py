"""The checks for `reconstruct`, `boundary` and `background`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Floats, Rims, Solid, Surface, open_edges
from damageest.conformance import _scene
from damageest.conformance._base import PlacementContract, check_or_refused, undo_placement
from damageest.geometry.distance import is_inside
from damageest.geometry.edges import list_edges

EMPTY = Surface(np.empty((0, 3)), np.empty((0, 3), int))


class ReconstructContract(PlacementContract):
    """Checks for `reconstruct`, on the points of one round dent."""

    def check_result(self, surface: Surface) -> None:
        """Asserts that the surface is open, covers the whole dent, and that its normals point to the lost metal."""
        from scipy.spatial import cKDTree

        centre, radius = _scene.DENTS[0]
        error = np.abs(np.linalg.norm(surface.vertices - centre, axis=1) - radius)
        assert np.quantile(error, 0.95) < _scene.TOLERANCE
        assert surface.area == pytest.approx(_scene.make_bowl().area, rel=0.15)
        reach = cKDTree(surface.triangles.mean(axis=1)).query(_scene.make_scene().points)[0]
        assert np.quantile(reach, 0.95) < 3 * _scene.TOLERANCE, "the surface does not cover all points"
        toward = np.einsum("ij,ij->i", surface.cross, centre - surface.triangles.mean(axis=1)) > 0
        assert toward.mean() > 0.95, "normals must point to the lost metal"
        self.check_usable(surface)

    def check_usable(self, surface: Surface) -> None:
        """Asserts that the surface is open and that at most two triangles share an edge."""
        assert open_edges(surface.faces), "the surface must have a boundary"
        edges = list_edges(surface.faces)
        assert np.unique(edges, axis=0, return_counts=True)[1].max() <= 2, "more than two triangles share an edge"

    def test_follows_the_dent(self) -> None:
        self.check_result(self.get_result())

    @pytest.mark.parametrize("count", [0, 1, 3, 10])
    def test_few_points(self, count: int) -> None:
        check_or_refused(lambda: self.run(points=_scene.make_scene().points[:count]), self.check_usable)

    def test_points_in_one_place(self) -> None:
        check_or_refused(
            lambda: self.run(points=np.repeat(_scene.make_scene().points[:1], 200, axis=0)), self.check_usable
        )

    def test_points_on_a_line(self) -> None:
        line = np.linspace([-5.0, -1, 3], [-1.0, -1, 3], 200)
        check_or_refused(lambda: self.run(points=line), self.check_usable)

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        self.check_result(Surface(undo_placement(got.vertices, scale, turn, shift), got.faces))


class BoundaryContract(PlacementContract):
    """Checks for `boundary`, on the surface of a round dent and the wall of a bore."""

    def check_loops(self, surface: Surface, rims: Rims) -> int:
        """Asserts that the loops use boundary edges only, each once, longest loop first. Gives the number of edges."""
        edges = [{*zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)} for loop in rims.loops]
        every = set().union(*edges)
        assert len(every) == sum(len(loop) for loop in rims.loops), "an edge is used twice"
        boundary_edges = _scene.find_boundary_edges(surface.faces)
        assert every <= boundary_edges | {(b, a) for a, b in boundary_edges}, "a loop leaves the boundary"
        assert [len(loop) for loop in rims.loops] == sorted((len(loop) for loop in rims.loops), reverse=True)
        return len(every)

    def test_the_open_edges_of_a_dent(self) -> None:
        assert self.check_loops(_scene.make_bowl(), self.get_result()) == _scene.SECTIONS

    def test_a_wall_has_one_rim_or_two(self) -> None:
        rims = self.run(surface=_scene.make_bore())
        assert len(rims.loops) in (1, 2)
        assert self.check_loops(_scene.make_bore(), rims) == len(rims.loops) * _scene.SECTIONS

    def test_a_closed_surface(self) -> None:
        part = _scene.make_prism()
        closed = Surface(part.vertices, part.faces)
        check_or_refused(lambda: self.run(surface=closed), lambda rims: self.check_loops(closed, rims))

    def test_an_empty_surface(self) -> None:
        check_or_refused(lambda: self.run(surface=EMPTY), lambda rims: self.check_loops(EMPTY, rims))

    def test_rims_that_meet_in_a_point(self) -> None:
        surface = _scene.make_bowl()
        # remove the triangles at the left and at the right neighbour of one vertex
        gone = np.isin(surface.faces, 5 * _scene.SECTIONS + np.array([0, 2])).any(axis=1)
        pinched = Surface(surface.vertices, surface.faces[~gone])
        check_or_refused(lambda: self.run(surface=pinched), lambda rims: self.check_loops(pinched, rims))

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        assert [set(loop.tolist()) for loop in got.loops] == [set(loop.tolist()) for loop in expected.loops]


class BackgroundContract(PlacementContract):
    """Checks for `background`."""

    def check_result(self, solid: Solid) -> None:
        """Asserts that the solid holds the damage surface and the damage."""
        inner = np.concatenate([_scene.make_bowl().vertices, _scene.make_dent(0).vertices])
        assert is_inside(inner, solid).all(), "the solid does not hold the damage"

    def test_holds_the_damage(self) -> None:
        self.check_result(self.get_result())

    def test_keeps_clear_of_the_damaged_skin(self) -> None:
        skin = _scene.make_dent(0).vertices
        above = skin[skin[:, 2] > _scene.HALF_HEIGHT - 1e-9] + [0, 0, 0.5 * _scene.TOLERANCE]
        assert is_inside(above, self.get_result()).all()

    def test_a_coarse_one_holds_it_too(self) -> None:
        self.check_result(self.run(fine=False))

    def test_a_sparse_scan(self) -> None:
        self.check_result(self.run(spacing=4 * _scene.SPACING))

    def test_an_empty_surface(self) -> None:
        check_or_refused(lambda: self.run(surface=EMPTY), self.check_result)

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        self.check_result(Solid(undo_placement(got.vertices, scale, turn, shift), got.faces))
        if np.array_equal(turn, np.eye(3)):
            assert got.volume / scale**3 == pytest.approx(expected.volume, rel=1e-3)
