"""The checks for stage `enclose`: site by site, and all sites at once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

from damageest.artefacts import DAMAGE, INTACT, Deviation, Enclosures, Floats, Mesh, Rims, Sites, Solid, Surface
from damageest.conformance import _scene
from damageest.conformance._base import PlacementContract, check_or_refused, undo_placement
from damageest.geometry.distance import distance_to_mesh, is_inside
from damageest.geometry.solids import iou, to_manifold, to_solid, unite


class EncloseContract(PlacementContract):
    """Checks for `enclose`, site by site, on a round dent in a flat face and on a worn-through bore.

    ``repair``: the implementation of `repair` that it needs, if its enclosures are not closed. ``error``: allowed
    error of the volume, as a share of the true volume.
    """

    repair: ClassVar[Any] = None
    error: ClassVar[float] = 0.03

    def repair_enclosure(self, enclosure: Mesh, tolerance: float = _scene.TOLERANCE) -> Solid:
        """The enclosure as a watertight solid, made in the same way as in the route."""
        if self.repair is None:
            return Solid(enclosure.vertices, enclosure.faces)
        given = {"enclosure": enclosure, "tolerance": tolerance}
        made = self.repair.run(**{name: given[name] for name in self.repair.needs()})
        assert isinstance(made, Solid)
        return made

    def cut_from_part(self, enclosure: Mesh) -> Solid:
        """The part of the unchanged prism that lies inside an enclosure."""
        lost = to_solid(to_manifold(self.repair_enclosure(enclosure)) ^ to_manifold(_scene.make_prism()))
        assert lost is not None, "the enclosure does not intersect the part"
        return lost

    def check_result(self, enclosure: Mesh) -> None:
        """Asserts that the enclosure holds the dent, and nothing else of the part."""
        true = _scene.make_dent(0)
        lost = self.cut_from_part(enclosure)
        assert lost.volume == pytest.approx(true.volume, rel=self.error)
        assert iou(lost, true) > 1 - 2 * self.error
        assert not _count_deep(_scene.make_scene().intact, enclosure), "intact points are inside the enclosure"

    def test_holds_the_damage_and_no_intact_points(self) -> None:
        self.check_result(self.get_result())

    def test_which_way_the_surface_is_wound_does_not_matter(self) -> None:
        surface, rims = _scene.make_bowl(), _scene.make_scene().rims
        turned = Surface(surface.vertices, surface.faces[:, ::-1])
        self.check_result(self.run(surface=turned, rims=Rims(tuple(loop[::-1] for loop in rims.loops))))

    def test_worn_through_is_right_or_refused(self) -> None:
        bore, count = _scene.make_bore(), _scene.SECTIONS
        first, last = np.arange(count), np.arange(len(bore.vertices) - count, len(bore.vertices))[::-1]
        points = _scene.make_prism()
        skin, _ = _scene.sample_points(points, 15_000, np.random.default_rng(3))
        skin = skin[np.hypot(*(skin[:, :2] - [-3, -1]).T) > _scene.BORE]
        wall, _ = _scene.sample_points(bore, 2500, np.random.default_rng(4))

        def check(enclosure: Mesh) -> None:
            true = np.pi * _scene.BORE**2 * 2 * _scene.HALF_HEIGHT
            assert self.cut_from_part(enclosure).volume == pytest.approx(true, rel=self.error)
            assert not _count_deep(skin, enclosure)

        check_or_refused(lambda: self.run(surface=bore, rims=Rims((first, last)), intact=skin, points=wall), check)

    def test_no_intact_points_to_find_the_side(self) -> None:
        check_or_refused(lambda: self.run(intact=np.empty((0, 3))), self.check_result)

    def test_no_rim(self) -> None:
        check_or_refused(lambda: self.run(rims=Rims(())), self.check_result)

    def test_an_empty_surface(self) -> None:
        empty = Surface(np.empty((0, 3)), np.empty((0, 3), int))
        check_or_refused(lambda: self.run(surface=empty, rims=Rims(())), self.check_result)

    def test_a_background_elsewhere(self) -> None:
        elsewhere = _scene.make_box(np.array([40.0, 40, 40]), np.array([50.0, 50, 50]), 3 * _scene.TOLERANCE)
        check_or_refused(lambda: self.run(background=elsewhere), self.check_result)

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        placed = self.repair_enclosure(got, scale * _scene.TOLERANCE)
        self.check_result(Mesh(undo_placement(placed.vertices, scale, turn, shift), placed.faces))


class EncloseAllContract(PlacementContract):
    """Checks for `enclose`, all sites at once, on two round dents on two faces.

    ``error``: allowed error of the volume, as a share of the true volume.
    """

    error: ClassVar[float] = 0.03

    def check_result(self, enclosures: Enclosures) -> None:
        """Asserts that the enclosures hold the dents and nothing else of the part, and name each site once."""
        part, truth = to_manifold(_scene.make_prism()), unite(_scene.make_dent(k) for k in (0, 1))
        assert sorted(k for item in enclosures.items for k in item.sites) == [1, 2]
        lost = unite(item.solid for item in enclosures.items) ^ part
        assert lost.volume() == pytest.approx(truth.volume(), rel=self.error)
        assert iou(to_solid(lost), to_solid(truth)) > 1 - 2 * self.error
        separate = sum((to_manifold(item.solid) ^ part).volume() for item in enclosures.items)
        assert separate == pytest.approx(lost.volume(), rel=1e-6), "enclosures overlap inside the part"
        for item in enclosures.items:
            assert not _count_deep(_scene.make_scene().intact, item.solid), "intact points are inside the enclosure"

    def test_holds_the_damage_and_no_intact_points(self) -> None:
        self.check_result(self.get_result())

    def test_each_site_is_in_the_enclosure_that_says_so(self) -> None:
        scene = _scene.make_scene()
        for item in self.get_result().items:
            near = scene.aligned.points[np.isin(scene.sites.label, item.sites)]
            low, high = item.solid.bounds
            assert ((near > low - _scene.TOLERANCE) & (near < high + _scene.TOLERANCE)).all()

    @pytest.mark.parametrize("kept", ["no intact points", "few points"])
    def test_a_scan_that_says_little(self, kept: str) -> None:
        scene = _scene.make_scene()
        chosen = np.flatnonzero(scene.sites.label) if kept == "no intact points" else np.arange(30)
        deviation = scene.deviation
        few = {
            "aligned": replace(scene.aligned, points=scene.aligned.points[chosen], normals=None),
            "deviation": Deviation(deviation.distance[chosen], deviation.face[chosen], deviation.label[chosen]),
            "sites": Sites(scene.sites.label[chosen], 2),
        }

        def check(enclosures: Enclosures) -> None:
            assert {k for item in enclosures.items for k in item.sites} <= {1, 2}

        check_or_refused(lambda: self.run(**few), check)

    def test_no_sites_no_enclosures(self) -> None:
        scene = _scene.make_scene()
        none = Sites(np.zeros(len(scene.aligned.points), np.int32), 0)
        distance = np.where(scene.deviation.label == DAMAGE, 0, scene.deviation.distance)
        intact = Deviation(distance, scene.deviation.face, np.full(len(distance), INTACT, np.uint8))
        got = self.run(sites=none, deviation=intact)
        assert isinstance(got, Enclosures)
        assert not got.items

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        def move_back(item: Any) -> Any:
            return type(item)(
                Solid(undo_placement(item.solid.vertices, scale, turn, shift), item.solid.faces), item.sites
            )

        self.check_result(Enclosures(tuple(move_back(item) for item in got.items)))


def _count_deep(points: Floats, mesh: Mesh) -> int:
    """How many of points (N,3) are inside a mesh and farther than the tolerance from its surface."""
    near = points[((points > mesh.bounds[0]) & (points < mesh.bounds[1])).all(axis=1)]
    if not len(near):
        return 0
    far = distance_to_mesh(near, mesh)
    return int((is_inside(near, mesh) & (far > _scene.TOLERANCE)).sum())
