"""The checks for the stages round the inner damage surface: `reconstruct`, `boundary` and `background`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Floats, Rims, Solid, Surface, open_edges
from damageest.conformance import _scene
from damageest.conformance._base import PlacedContract, back, right_or_refused
from damageest.geometry.distance import is_inside

EMPTY = Surface(np.empty((0, 3)), np.empty((0, 3), int))


class ReconstructContract(PlacedContract):
    """Checks for `reconstruct`, on the points of one round dent."""

    def right(self, surface: Surface) -> None:
        """An open surface along the dent, all of it, and facing what is lost."""
        from scipy.spatial import cKDTree

        centre, radius = _scene.DENTS[0]
        off = np.abs(np.linalg.norm(surface.vertices - centre, axis=1) - radius)
        assert np.quantile(off, 0.95) < _scene.TOLERANCE
        assert surface.area == pytest.approx(_scene.bowl().area, rel=0.15)
        reach = cKDTree(surface.triangles.mean(axis=1)).query(_scene.scene().points)[0]
        assert np.quantile(reach, 0.95) < 3 * _scene.TOLERANCE, "points without a surface"
        toward = np.einsum("ij,ij->i", surface.cross, centre - surface.triangles.mean(axis=1)) > 0
        assert toward.mean() > 0.95, "normals face the lost material"
        self.sound(surface)

    def sound(self, surface: Surface) -> None:
        assert open_edges(surface.faces), "a damage surface is open"
        edges = np.sort(surface.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        assert np.unique(edges, axis=0, return_counts=True)[1].max() <= 2, "three triangles at one edge"

    def test_follows_the_dent(self) -> None:
        self.right(self.plain())

    @pytest.mark.parametrize("count", [0, 1, 3, 10])
    def test_few_points(self, count: int) -> None:
        right_or_refused(lambda: self.run(points=_scene.scene().points[:count]), self.sound)

    def test_points_in_one_place(self) -> None:
        right_or_refused(lambda: self.run(points=np.repeat(_scene.scene().points[:1], 200, axis=0)), self.sound)

    def test_points_on_a_line(self) -> None:
        line = np.linspace([-5.0, -1, 3], [-1.0, -1, 3], 200)
        right_or_refused(lambda: self.run(points=line), self.sound)

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        self.right(Surface(back(got.vertices, scale, turn, shift), got.faces))


class BoundaryContract(PlacedContract):
    """Checks for `boundary`, on the surface of a round dent and the wall of a bore."""

    def follows(self, surface: Surface, rims: Rims) -> int:
        """How many edges the loops have, each an open one of the surface and each once; the longest loop first."""
        edges = [{*zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)} for loop in rims.loops]
        every = set().union(*edges)
        assert len(every) == sum(len(loop) for loop in rims.loops), "an edge twice"
        open_ones = _scene.open_loops(surface.faces)
        assert every <= open_ones | {(b, a) for a, b in open_ones}, "a rim leaves the open edges"
        assert [len(loop) for loop in rims.loops] == sorted((len(loop) for loop in rims.loops), reverse=True)
        return len(every)

    def test_the_open_edges_of_a_dent(self) -> None:
        assert self.follows(_scene.bowl(), self.plain()) == _scene.SECTIONS

    def test_a_wall_has_one_rim_or_two(self) -> None:
        rims = self.run(surface=_scene.bore())
        assert len(rims.loops) in (1, 2)
        assert self.follows(_scene.bore(), rims) == len(rims.loops) * _scene.SECTIONS

    def test_a_closed_surface(self) -> None:
        part = _scene.prism()
        closed = Surface(part.vertices, part.faces)
        right_or_refused(lambda: self.run(surface=closed), lambda rims: self.follows(closed, rims))

    def test_an_empty_surface(self) -> None:
        right_or_refused(lambda: self.run(surface=EMPTY), lambda rims: self.follows(EMPTY, rims))

    def test_rims_that_meet_in_a_point(self) -> None:
        surface = _scene.bowl()
        # Two neighbours of one vertex, left and right of it, lose their triangles.
        gone = np.isin(surface.faces, 5 * _scene.SECTIONS + np.array([0, 2])).any(axis=1)
        pinched = Surface(surface.vertices, surface.faces[~gone])
        right_or_refused(lambda: self.run(surface=pinched), lambda rims: self.follows(pinched, rims))

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        assert [set(loop.tolist()) for loop in got.loops] == [set(loop.tolist()) for loop in plain.loops]


class BackgroundContract(PlacedContract):
    """Checks for `background`."""

    def right(self, solid: Solid) -> None:
        """Holds the damage surface and what is lost."""
        inner = np.concatenate([_scene.bowl().vertices, _scene.dent(0).vertices])
        assert is_inside(inner, solid).all(), "it does not hold the damage"

    def test_holds_the_damage(self) -> None:
        self.right(self.plain())

    def test_keeps_clear_of_the_damaged_skin(self) -> None:
        skin = _scene.dent(0).vertices
        above = skin[skin[:, 2] > _scene.HALF_HEIGHT - 1e-9] + [0, 0, 0.5 * _scene.TOLERANCE]
        assert is_inside(above, self.plain()).all()

    def test_a_coarse_one_holds_it_too(self) -> None:
        self.right(self.run(fine=False))

    def test_a_sparse_scan(self) -> None:
        self.right(self.run(spacing=4 * _scene.SPACING))

    def test_an_empty_surface(self) -> None:
        right_or_refused(lambda: self.run(surface=EMPTY), self.right)

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        self.right(Solid(back(got.vertices, scale, turn, shift), got.faces))
        if np.array_equal(turn, np.eye(3)):
            assert got.volume / scale**3 == pytest.approx(plain.volume, rel=1e-3)
