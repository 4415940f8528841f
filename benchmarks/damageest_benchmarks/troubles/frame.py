"""Troubles of frame, unit and identity: another part, another pose, another unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Mesh
from damageest_benchmarks.troubles.parts import make_named_part
from damageest_benchmarks.troubles.scene import Scanning, TroubleScene


def scan_other_part(case: Scanning) -> TroubleScene:
    """The scan shows another part than the job's. ``amount``: the number of the other part."""
    other = make_named_part(("coupling", "tube", "lever", "keyed_shaft", "block")[int(case.amount)])
    return _without_pose(case, other)


def scan_mirrored_part(case: Scanning) -> TroubleScene:
    """The scan shows the part's mirror image, as of the left-hand version."""
    centre = case.part.bounds.mean(axis=0)
    mirrored = Mesh((case.part.vertices - centre) * (-1, 1, 1) + centre, case.part.faces[:, ::-1])
    return _without_pose(case, mirrored)


def _without_pose(case: Scanning, shown: Mesh) -> TroubleScene:
    moved = Mesh(shown.vertices + case.part.bounds.mean(axis=0) - shown.bounds.mean(axis=0), shown.faces)
    scene = case.scan(moved, None)
    return replace(scene, has_pose=False, damage=None, added=True)


def shift_frame(case: Scanning) -> TroubleScene:
    """The pose that the job is given is off by ``amount`` mm. With an ordinary damage."""
    scene = case.scan(*case.damage("pit"))
    direction = case.make_rng(15).normal(size=3)
    shift = np.eye(4)
    shift[:3, 3] = case.amount * direction / np.linalg.norm(direction)
    return replace(scene, shift=shift)


def change_unit(case: Scanning) -> TroubleScene:
    """The scan's numbers are in another unit than the job says. ``amount``: factor of the numbers."""
    scene = case.scan(*case.damage("pit"))
    scanners = None if scene.scanners is None else case.amount * scene.scanners
    return replace(scene, points=case.amount * scene.points, scanners=scanners, has_pose=False)
