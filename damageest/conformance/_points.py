"""The checks for the stages that sort a scan's points: `align`, `segment` and `cluster`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

from damageest.artefacts import ADDED, DAMAGE, INTACT, Deviation, Floats, Pose, Scan, Sites
from damageest.conformance import _scene
from damageest.conformance._base import FAR, TURN, PlacedContract, right_or_refused


def motion(turn: Floats, shift: Floats) -> Floats:
    """The pose (4,4) of a rotation and a shift."""
    return np.block([[turn, np.reshape(shift, (3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]])


NEAR = motion(
    np.array([[0.9986295348, -0.0523359562, 0.0], [0.0523359562, 0.9986295348, 0.0], [0.0, 0.0, 1.0]]),
    np.array([0.1, -0.1, 0.1]),
)
"""Three degrees and a small shift."""


class AlignContract(PlacedContract):
    """Checks for `align`.

    ``pose`` (4,4): the true one, T_part_scan. The default is far from no motion; give NEAR, or ``np.eye(4)``, to what
    starts from no motion and goes on from there, or takes it as given.
    """

    pose: ClassVar[Floats] = motion(TURN, FAR / 1e3)

    def scene(self) -> dict[str, Any]:
        return {**super().scene(), "scan": self.of_scanner(_scene.scene().aligned.points)}

    def of_scanner(self, points: Floats) -> Scan:
        """Points (N,3) in the part's frame, as a scan in the scanner's, without normals."""
        turn, shift = self.pose[:3, :3], self.pose[:3, 3]
        return Scan((points - shift) @ turn, noise=_scene.NOISE, spacing=_scene.SPACING)

    def right(self, pose: Pose) -> None:
        self.agree(pose, pose, 1.0, np.eye(3), np.zeros(3))

    def rigid(self, pose: Pose) -> None:
        turn = pose.T_part_scan[:3, :3]
        assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(turn) > 0
        assert np.array_equal(pose.T_part_scan[3], [0, 0, 0, 1])
        assert np.isfinite(pose.T_part_scan).all()

    def test_finds_the_pose(self) -> None:
        self.right(self.plain())

    def test_says_how_well_it_fits(self) -> None:
        points, pose = _scene.scene().deviation, self.plain()
        assert pose.inliers == pytest.approx((points.label == INTACT).mean(), abs=0.05)
        assert 0 < pose.rms < _scene.TOLERANCE

    @pytest.mark.parametrize("count", [0, 1, 3])
    def test_few_points(self, count: int) -> None:
        right_or_refused(lambda: self.run(scan=self.of_scanner(_scene.scene().aligned.points[:count])), self.rigid)

    def test_points_that_are_not_finite(self) -> None:
        points = _scene.scene().aligned.points.copy()
        points[::50] = np.nan
        right_or_refused(lambda: self.run(scan=self.of_scanner(points)), self.right)

    def test_a_scan_of_something_else(self) -> None:
        way = np.random.default_rng(2).normal(size=(5000, 3))
        ball = 9 * way / np.linalg.norm(way, axis=1)[:, None]

        def right(pose: Pose) -> None:
            assert pose.inliers < 0.35, "a ball is no prism"

        right_or_refused(lambda: self.run(scan=self.of_scanner(ball)), right)

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        """Whether it puts the scan where it belongs."""
        self.rigid(got)
        scan = _scene.place(self.scene()["scan"], scale, turn, shift).move(got.T_part_scan)
        there = _scene.place(_scene.scene().aligned.points, scale, turn, shift)
        off = np.linalg.norm(scan.points - there, axis=1) / scale
        assert off.max() < 0.25 * _scene.TOLERANCE, "the pose is off"


class SegmentContract(PlacedContract):
    """Checks for `segment`. ``error``: share of the points whose label may be another than by the exact distance."""

    error: ClassVar[float] = 0.01

    def right(self, deviation: Deviation, tolerance: float = _scene.TOLERANCE) -> None:
        exact = _scene.scene().deviation.distance
        label = np.where(exact < -tolerance, DAMAGE, np.where(exact > tolerance, ADDED, INTACT))
        assert (deviation.label != label).mean() <= self.error
        wrong = np.sign(deviation.distance) != np.sign(exact)
        assert not (wrong & (np.abs(exact) > tolerance)).any(), "distance is positive outside"
        assert ((deviation.face >= 0) & (deviation.face < len(_scene.scene().part.faces))).all()

    def test_labels_the_dents(self) -> None:
        self.right(self.plain())

    def test_twice_the_tolerance(self) -> None:
        self.right(self.run(tolerance=2 * _scene.TOLERANCE), 2 * _scene.TOLERANCE)

    def test_added_metal(self) -> None:
        bead = np.array([4.0, 0, 4]) + np.random.default_rng(6).uniform([-1, -1, 0.5], [1, 1, 1], (50, 3))
        deviation = self.run(aligned=Scan(bead))
        assert (deviation.label == ADDED).all()
        assert deviation.distance == pytest.approx(bead[:, 2] - 4, abs=_scene.TOLERANCE)

    @pytest.mark.parametrize("count", [0, 1])
    def test_few_points(self, count: int) -> None:
        def right(deviation: Deviation) -> None:
            assert len(deviation.label) == len(deviation.distance) == len(deviation.face) == count

        right_or_refused(lambda: self.run(aligned=Scan(_scene.scene().aligned.points[:count])), right)

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        assert (got.label != plain.label).mean() < 1e-3
        off = np.abs(got.distance / scale - plain.distance) > 1e-3 * _scene.TOLERANCE
        assert off.mean() < 1e-2, "the distance depends on where the part lies, or how large it is"


class ClusterContract(PlacedContract):
    """Checks for `cluster`. ``error``: share of the damage's points that may be in no site, or in another."""

    error: ClassVar[float] = 0.05

    def right(self, sites: Sites) -> None:
        true = _scene.scene().sites.label
        assert sites.count == 2
        assert sites.label.shape == true.shape
        for k in (1, 2):
            found = np.bincount(sites.label[true == k], minlength=3)
            assert found[1:].max() >= (1 - self.error) * found.sum(), "a dent is in one site"
        assert not sites.label[_scene.scene().deviation.label != DAMAGE].any(), "what is no damage is in no site"
        assert np.array_equal(np.unique(sites.label), [0, 1, 2])

    def test_one_site_for_each_dent(self) -> None:
        self.right(self.plain())

    def test_no_damage_no_sites(self) -> None:
        deviation = _scene.scene().deviation
        sound = replace(deviation, label=np.full(len(deviation.label), INTACT, np.uint8))
        sites = self.run(deviation=sound)
        assert sites.count == 0
        assert not sites.label.any()

    @pytest.mark.parametrize("count", [0, 1, 4])
    def test_few_points(self, count: int) -> None:
        scan = Scan(_scene.scene().points[:count])
        deviation = Deviation(np.full(count, -1.0), np.zeros(count, int), np.full(count, DAMAGE, np.uint8))

        def right(sites: Sites) -> None:
            assert sites.label.shape == (count,)
            assert sites.count == sites.label.max(initial=0)

        right_or_refused(lambda: self.run(aligned=scan, deviation=deviation), right)

    def agree(self, got: Any, plain: Any, scale: float, turn: Floats, shift: Floats) -> None:
        assert got.count == plain.count
        assert (got.label != plain.label).mean() < 1e-3
