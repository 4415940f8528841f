"""The checks for the stages that align, label and cluster a scan's points."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

from damageest.artefacts import ADDED, DAMAGE, INTACT, Deviation, Floats, Pose, Scan, Sites
from damageest.conformance import _scene
from damageest.conformance._base import FAR, TURN, PlacementContract, check_or_refused
from damageest.errors import StageError


def make_pose(turn: Floats, shift: Floats) -> Floats:
    """The pose (4,4) of a rotation and a shift."""
    return np.block([[turn, np.reshape(shift, (3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]])


NEAR = make_pose(
    np.array([[0.9986295348, -0.0523359562, 0.0], [0.0523359562, 0.9986295348, 0.0], [0.0, 0.0, 1.0]]),
    np.array([0.1, -0.1, 0.1]),
)
"""A pose of three degrees and a small shift."""


class AlignContract(PlacementContract):
    """Checks for `align`.

    ``pose`` (4,4): the true T_part_scan. The default is far from the identity. Use NEAR for an implementation that
    starts at the identity, and ``np.eye(4)`` for one that does not move the scan.
    """

    pose: ClassVar[Floats] = make_pose(TURN, FAR / 1e3)

    def make_scene(self) -> dict[str, Any]:
        return {**super().make_scene(), "scan": self.move_to_scanner(_scene.make_scene().aligned.points)}

    def move_to_scanner(self, points: Floats) -> Scan:
        """A scan in the scanner's frame, without normals, of points (N,3) in the part's frame."""
        turn, shift = self.pose[:3, :3], self.pose[:3, 3]
        return Scan((points - shift) @ turn, noise=_scene.NOISE, spacing=_scene.SPACING)

    def check_result(self, pose: Pose) -> None:
        """Asserts that the pose moves the scan onto the part."""
        self.check_agrees(pose, pose, 1.0, np.eye(3), np.zeros(3))

    def check_rigid(self, pose: Pose) -> None:
        """Asserts that the pose is a finite rotation and shift."""
        turn = pose.T_part_scan[:3, :3]
        assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(turn) > 0
        assert np.array_equal(pose.T_part_scan[3], [0, 0, 0, 1])
        assert np.isfinite(pose.T_part_scan).all()

    def test_finds_the_pose(self) -> None:
        self.check_result(self.get_result())

    def test_says_how_well_it_fits(self) -> None:
        deviation, pose = _scene.make_scene().deviation, self.get_result()
        assert pose.inliers == pytest.approx((deviation.label == INTACT).mean(), abs=0.05)
        assert 0 < pose.rms < _scene.TOLERANCE

    def test_says_whether_the_pose_is_fitted(self) -> None:
        """A pose that stays where the scan lies elsewhere by a fifth of the tolerance is a known one."""
        scan: Scan = self.make_scene()["scan"]
        shift = np.array([0.1, 0.13, 0.11]) * _scene.TOLERANCE
        try:
            moved = self.run(scan=replace(scan, points=scan.points + shift))
        except StageError:
            pytest.skip("it refuses a scan that lies elsewhere")
        stays = np.allclose(moved.T_part_scan, self.get_result().T_part_scan, rtol=0, atol=1e-9)
        fitted = type(self.stage).gives_fitted_pose
        does = "stays" if stays else "changes"
        assert fitted != stays, f"gives_fitted_pose is {fitted}, but the pose {does} where the scan lies elsewhere"

    @pytest.mark.parametrize("count", [0, 1, 3])
    def test_few_points(self, count: int) -> None:
        check_or_refused(
            lambda: self.run(scan=self.move_to_scanner(_scene.make_scene().aligned.points[:count])), self.check_rigid
        )

    def test_points_that_are_not_finite(self) -> None:
        points = _scene.make_scene().aligned.points.copy()
        points[::50] = np.nan
        check_or_refused(lambda: self.run(scan=self.move_to_scanner(points)), self.check_result)

    def test_a_scan_of_something_else(self) -> None:
        way = np.random.default_rng(2).normal(size=(5000, 3))
        ball = 9 * way / np.linalg.norm(way, axis=1)[:, None]

        def check(pose: Pose) -> None:
            assert pose.inliers < 0.35, "the scan of a ball does not fit a prism"

        check_or_refused(lambda: self.run(scan=self.move_to_scanner(ball)), check)

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        """Asserts that the pose moves the scan onto the scaled, turned and shifted part."""
        self.check_rigid(got)
        scan = _scene.transform(self.make_scene()["scan"], scale, turn, shift).move(got.T_part_scan)
        target = _scene.transform(_scene.make_scene().aligned.points, scale, turn, shift)
        off = np.linalg.norm(scan.points - target, axis=1) / scale
        assert off.max() < 0.25 * _scene.TOLERANCE, "the pose is wrong"


class SegmentContract(PlacementContract):
    """Checks for `segment`. ``error``: allowed share of points with a wrong label."""

    error: ClassVar[float] = 0.01

    def check_result(self, deviation: Deviation, tolerance: float = _scene.TOLERANCE) -> None:
        exact = _scene.make_scene().deviation.distance
        label = np.where(exact < -tolerance, DAMAGE, np.where(exact > tolerance, ADDED, INTACT))
        assert (deviation.label != label).mean() <= self.error
        wrong = np.sign(deviation.distance) != np.sign(exact)
        assert not (wrong & (np.abs(exact) > tolerance)).any(), "the distance must be positive outside the part"
        assert ((deviation.face >= 0) & (deviation.face < len(_scene.make_scene().part.faces))).all()

    def test_labels_the_dents(self) -> None:
        self.check_result(self.get_result())

    def test_twice_the_tolerance(self) -> None:
        self.check_result(self.run(tolerance=2 * _scene.TOLERANCE), 2 * _scene.TOLERANCE)

    def test_added_metal(self) -> None:
        bead = np.array([4.0, 0, 4]) + np.random.default_rng(6).uniform([-1, -1, 0.5], [1, 1, 1], (50, 3))
        deviation = self.run(aligned=Scan(bead))
        assert (deviation.label == ADDED).all()
        assert deviation.distance == pytest.approx(bead[:, 2] - 4, abs=_scene.TOLERANCE)

    @pytest.mark.parametrize("count", [0, 1])
    def test_few_points(self, count: int) -> None:
        def check(deviation: Deviation) -> None:
            assert len(deviation.label) == len(deviation.distance) == len(deviation.face) == count

        check_or_refused(lambda: self.run(aligned=Scan(_scene.make_scene().aligned.points[:count])), check)

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        assert (got.label != expected.label).mean() < 1e-3
        off = np.abs(got.distance / scale - expected.distance) > 1e-3 * _scene.TOLERANCE
        assert off.mean() < 1e-2, "the distance does not scale or move with the scene"


class ClusterContract(PlacementContract):
    """Checks for `cluster`. ``error``: allowed share of a damage's points that are not in its site."""

    error: ClassVar[float] = 0.05

    def check_result(self, sites: Sites) -> None:
        true = _scene.make_scene().sites.label
        assert sites.count == 2
        assert sites.label.shape == true.shape
        for k in (1, 2):
            found = np.bincount(sites.label[true == k], minlength=3)
            assert found[1:].max() >= (1 - self.error) * found.sum(), "a dent is not in one site"
        assert not sites.label[_scene.make_scene().deviation.label != DAMAGE].any(), "a site holds intact points"
        assert np.array_equal(np.unique(sites.label), [0, 1, 2])

    def test_one_site_for_each_dent(self) -> None:
        self.check_result(self.get_result())

    def test_no_damage_no_sites(self) -> None:
        deviation = _scene.make_scene().deviation
        intact = replace(deviation, label=np.full(len(deviation.label), INTACT, np.uint8))
        sites = self.run(deviation=intact)
        assert sites.count == 0
        assert not sites.label.any()

    @pytest.mark.parametrize("count", [0, 1, 4])
    def test_few_points(self, count: int) -> None:
        scan = Scan(_scene.make_scene().points[:count])
        deviation = Deviation(np.full(count, -1.0), np.zeros(count, int), np.full(count, DAMAGE, np.uint8))

        def check(sites: Sites) -> None:
            assert sites.label.shape == (count,)
            assert sites.count == sites.label.max(initial=0)

        check_or_refused(lambda: self.run(aligned=scan, deviation=deviation), check)

    def check_agrees(self, got: Any, expected: Any, scale: float, turn: Floats, shift: Floats) -> None:
        assert got.count == expected.count
        assert (got.label != expected.label).mean() < 1e-3
