"""Troubles of the shape: the part is larger, bent, twisted or welded."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Solid
from damageest_benchmarks.troubles.scene import Scanning, TroubleScene


def scale_scan(case: Scanning) -> TroubleScene:
    """The scan of an undamaged part is ``amount`` times as large as it should be."""
    return scale_scene(case, case.part, None)


def scale_scene(case: Scanning, left: Mesh, damage: Solid | None) -> TroubleScene:
    """The scan of what is ``left`` of a part is ``amount`` times as large as it should be."""
    scene = case.scan(left, damage)
    centre = case.part.bounds.mean(axis=0)

    def deform(at: Floats) -> Floats:
        return np.asarray(centre + case.amount * (at - centre))

    scanners = None if scene.scanners is None else deform(scene.scanners)
    return replace(scene, points=deform(scene.points), scanners=scanners, deform=deform)


def bend_part(case: Scanning) -> TroubleScene:
    """The undamaged part is bent: its ends are off by ``amount`` of its longest edge."""
    return _deform(case, _bend, case.amount)


def twist_part(case: Scanning) -> TroubleScene:
    """The undamaged part is twisted by ``amount`` degrees from end to end of its longest axis."""
    return _deform(case, _twist, case.amount)


def _deform(case: Scanning, move: Any, amount: float) -> TroubleScene:
    def deform(at: Floats) -> Floats:
        return np.asarray(move(case.part, at, amount))

    points = deform(case.scan(case.part, None, noise=0).points)
    points += case.make_rng(12).normal(scale=case.noise, size=points.shape)
    return replace(case.scan(case.part, None), points=points, deform=deform)


def _bend(part: Mesh, at: Floats, amount: float) -> Floats:
    low, high = part.bounds
    axis, across = int(np.argmax(high - low)), int(np.argmin(high - low))
    t = (at[:, axis] - low[axis]) / (high - low)[axis]
    points = at.copy()
    # one end stays where it is
    points[:, across] += amount * (high - low)[axis] * t**2
    return points


def _twist(part: Mesh, at: Floats, amount: float) -> Floats:
    low, high = part.bounds
    axis = int(np.argmax(high - low))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    angle = np.radians(amount) * (at[:, axis] - low[axis]) / (high - low)[axis]
    points = at.copy()
    off = at - part.bounds.mean(axis=0)
    points[:, u] = part.bounds.mean(axis=0)[u] + np.cos(angle) * off[:, u] - np.sin(angle) * off[:, v]
    points[:, v] = part.bounds.mean(axis=0)[v] + np.sin(angle) * off[:, u] + np.cos(angle) * off[:, v]
    return points


def weld_bead(case: Scanning) -> TroubleScene:
    """A weld bead on the top face. ``amount`` 0: no damage; 1: a dent beside it; 2: over the rim of the dent."""
    from manifold3d import Manifold

    high = case.part.bounds[1]
    size = case.part.diagonal
    x, y = {"cuboid": (5.0, 3.0), "plate": (-6.0, 2.0), "cylinder": (0.0, 0.0)}[case.name]
    dent = Manifold.sphere(0.05 * size, 128).translate((x, y, high[2] + 0.02 * size))
    away = 0.095 * size if case.amount == 1 else 0.035 * size
    bead = Manifold.sphere(1.0, 96).scale((0.09 * size, 0.03 * size, 0.02 * size)).translate((x, y + away, high[2]))
    left, damage = case.cut(dent if case.amount else None, bead)
    return replace(case.scan(left, damage), added=True)
