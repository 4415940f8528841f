"""Scans that are hard to place, and normals that point the wrong way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Mesh
from damageest.geometry.solids import to_arrays, to_manifold, to_solid
from damageest_benchmarks.families.scene import Draw
from damageest_benchmarks.reported.bench import Bench, bite, cut, read_again, take
from damageest_benchmarks.troubles.parts import make_named_part


def turned_by_a_tooth() -> Draw:
    """A gear of twenty equal teeth, one of them broken off."""
    bench = take("gear", 60, (1, 0, 1), 0.06)
    return bench.finish(bench.scan(26_000)[0])


def cylinder_at_any_angle() -> Draw:
    """A plain cylinder with a chip."""
    bench = take("cylinder", 61, (1, 0, 1), 0.08)
    return bench.finish(bench.scan()[0])


def one_flat_face() -> Draw:
    """Only the inner part of one flat face was scanned, with a pit: it fits at many places of the part."""
    part = make_named_part("cuboid", 0.0)
    bench = bite(part, 62, (6.0, 4.0, 17.0), 7.0)
    points = bench.scan(60_000)[0]
    keep = (points[:, 2] > 5) & (np.abs(points[:, 0]) < 25) & (np.abs(points[:, 1]) < 18)
    return bench.finish(points[keep])


def patch_round_the_damage() -> Draw:
    """Only what is near the damage was scanned, a tenth of the skin."""
    bench = take("lever", 63, (1, 0, 1), 0.06)
    assert bench.damage is not None
    points = bench.scan(80_000)[0]
    gap = np.linalg.norm(points - bench.damage.bounds.mean(axis=0), axis=1)
    return bench.finish(points[gap < 0.2 * bench.part.diagonal])


def fragment_of_the_part() -> Draw:
    """The piece that broke off was scanned, and not the part: two thirds of the metal are not there."""
    from manifold3d import Manifold

    part = make_named_part("keyed_shaft", 0.0)
    rough = Manifold.cube((60, 60, 80), True).refine_to_length(2.0)
    rng = np.random.default_rng(64)
    wave, phase = rng.normal(scale=0.25, size=(8, 2)), rng.uniform(0, 6.28, 8)

    def shake(at: np.ndarray) -> np.ndarray:
        rise = np.cos(at[:, :2] @ wave.T + phase).sum(axis=1) * 0.5
        at[:, 2] += rise
        return at

    return _finish(cut(part, 64, rough.warp_batch(shake).translate((0, 0, 20))))


def _finish(bench: Bench) -> Draw:
    return bench.finish(bench.scan()[0])


def flush_notch() -> Draw:
    """A loss whose walls lie in the planes of the part's faces."""
    from manifold3d import Manifold

    part = make_named_part("cuboid", 0.0)
    return _finish(cut(part, 65, Manifold.cube((18, 14, 10)).translate((17, 11, 5))))


def _with_normals(bench: Bench, flip: str) -> Draw:
    points, normals = bench.scan()
    if flip == "patches":
        places = points[bench.rng.choice(len(points), 12, replace=False)]
        gap = np.linalg.norm(points[:, None] - places, axis=2).min(axis=1)
        normals = np.where((gap < 0.1 * bench.part.diagonal)[:, None], -normals, normals)
    elif flip == "all":
        normals = -normals
    return bench.finish(points, normals)


def normals_wrong_in_patches() -> Draw:
    """Normals of a third of the scan point inward, in patches."""
    return _with_normals(take("block", 66), "patches")


def normals_inward() -> Draw:
    """All normals point into the part."""
    return _with_normals(take("block", 67), "all")


def normals_of_a_mirrored_half() -> Draw:
    """Half of a symmetric part was mirrored to make the whole, and the normals were not: the notch lies across."""
    part = make_named_part("cuboid", 0.0)
    bench = bite(part, 68, (0.0, 25.0, 15.0), 8.0)
    points, normals = bench.scan(24_000)
    half = points[:, 0] > 0
    points, normals = points[half], normals[half]
    return bench.finish(np.concatenate([points, points * [-1, 1, 1]]), np.concatenate([normals, normals]))


def normals_that_are_no_numbers() -> Draw:
    """A program wrote nan for all normals when it froze the pose."""
    draw = _finish(take("block", 69))
    return read_again(draw, {name: np.full(len(draw.scan.points), np.nan) for name in ("nx", "ny", "nz")})


def two_pieces_apart() -> Draw:
    """Two fragments in one scan, put together wrongly: one is turned over beside the other."""
    from manifold3d import Manifold

    bench = take("block", 70)
    body = to_manifold(bench.left)
    near = Mesh(*to_arrays(body.trim_by_plane((1, 0.2, 0), 0.0)))
    far = Mesh(*to_arrays(body.trim_by_plane((-1, -0.2, 0), 0.0)))
    turned = np.diag([1.0, -1.0, -1.0])
    one, other = bench.scan(12_000, near)[0], bench.scan(12_000, far)[0] @ turned - [12, 0, 0]
    whole = to_manifold(bench.part)
    kept = to_manifold(near)
    lost = to_solid(whole - kept + Manifold())
    return replace(bench.finish(np.concatenate([one, other])), damage=lost)
