"""Draws points without errors on what a virtual scanner has before it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydantic import ConfigDict, Field

from damageest.artefacts import Floats, Ints, Mesh, Part
from damageest.geometry.vectors import normalise
from damageest.options import Options
from damageest.stages.scan import _random_field, _views
from damageest.stages.scan._scene import Scene
from damageest.stages.scan.scanner import sample_seen
from damageest.stages.scan.tools import Direction, Vector


class UnseenRegion(Options):
    """A region of the surface that the virtual scanner does not see."""

    model_config = ConfigDict(defer_build=True)
    direction: Direction = Field(description="direction in the part's frame; its length does not matter")
    angle: float = Field(
        60.0,
        gt=0,
        le=180,
        description="no points where the angle between outward normal and `direction` is smaller than this, in degrees",
    )
    beyond: Vector | None = Field(
        None,
        description="instead of `angle`: no points beyond the plane through this point with `direction` as its normal",
    )


@dataclass(frozen=True, eq=False)
class Drawing:
    """How points are drawn. ``scanners``: positions (V,3), a number of them, or None. ``mixed``: the number of mixed
    pixels. The others are the options of `simulate` of the same names, with their defaults filled in."""

    scanners: Floats | int | None
    max_incidence: float
    unseen: tuple[UnseenRegion, ...]
    density: float
    patches: float
    patch_size: float
    stripes: float
    mixed: int
    seed: int


@dataclass(frozen=True, eq=False)
class Draw:
    """Points (N,3) without errors, ``toward`` (N,3): the unit vector along which depth errors move each, ``facing``
    (N,): the cosine of the incidence angle, ``view`` (N,) the number of its scanner of ``scanners`` (V,3)."""

    points: Floats
    toward: Floats
    facing: Floats
    view: Ints
    scanners: Floats
    notes: tuple[str, ...] = ()


def draw_points(scene: Scene, part: Part, how: Drawing, count: int, rng: np.random.Generator) -> Draw:
    """``count`` points in the part's frame."""
    normal = scene.body.face_normals
    faces = ~scene.bare
    planes = []
    for item in how.unseen:
        toward = np.array(item.direction) / np.linalg.norm(item.direction)
        if item.beyond is None:
            faces &= normal @ toward < np.cos(np.radians(item.angle))
        else:
            planes.append((toward, float(toward @ item.beyond)))
    weigh = _make_weights(scene.body, part, how, planes)
    if how.scanners is None:
        spare = 2.5 if how.density else 1.0
        points, face = sample_seen(scene.body, faces, count, rng, weigh, spare)
        return Draw(points, normal[face], np.ones(len(points)), np.zeros(len(points), np.int64), np.empty((0, 3)))
    centre = part.bounds.mean(axis=0)
    if isinstance(how.scanners, int):
        scanners = _views.spread_scanners(how.scanners, centre, 3 * part.diagonal, rng)
    else:
        scanners = how.scanners
    highest = np.exp(2.5 * how.density)
    keep = None if weigh is None else (lambda points: weigh(points) / highest)
    lines = _views.Stripes(how.stripes, centre, how.seed) if how.stripes else None
    seen = _views.sample_views(scene.body, faces, scanners, count, how.max_incidence, rng, keep, lines)
    points, view, facing, notes = seen.points, seen.view, seen.facing, []
    if how.mixed:
        mixed, owner = _views.find_mixed(scene.body, scanners, seen, how.mixed, rng)
        points = np.concatenate([points[len(mixed) :], mixed])
        view = np.concatenate([view[len(mixed) :], owner])
        facing = np.concatenate([facing[len(mixed) :], np.ones(len(mixed))])
        if not len(mixed):
            notes.append("no mixed pixels: no surface is in front of another")
    way = scanners[view] - points
    used, view = np.unique(view, return_inverse=True)
    if len(used) < len(scanners):  # a view without points is no view
        blind = sorted(set(range(len(scanners))) - set(used.tolist()))
        notes.append(f"no points from scanner {', '.join(str(number + 1) for number in blind)}")
        scanners = scanners[used]
    return Draw(points, normalise(way), facing, view, scanners, tuple(notes))


def _make_weights(
    body: Mesh, part: Part, how: Drawing, planes: list[tuple[Floats, float]]
) -> Callable[[Floats], Floats] | None:
    """A function of points (N,3) that gives the density (N,) there, 0 where there are none; None where it is even."""
    if not (how.density or planes or how.patches):
        return None
    field = _random_field.RandomField.build(part.diagonal / 2, 1, how.seed, waves=8)
    bare = None
    if how.patches:
        bare = _random_field.choose_patches(body, how.patches, how.patch_size, how.seed + 500_009)

    def weigh(points: Floats) -> Floats:
        weights = np.exp(how.density * field.evaluate(points)) if how.density else np.ones(len(points))
        for toward, height in planes:
            weights[points @ toward > height] = 0
        if bare is not None:
            weights[bare(points)] = 0
        return weights

    return weigh
