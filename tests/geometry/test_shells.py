"""Parts of several bodies that others export: touching, overlapping, nested or a little apart, any of them turned."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Floats, Mesh
from damageest.geometry.make_part import make_part
from damageest.geometry.shells import Shells, label_components
from damageest.geometry.solids import subtract_lost, unite
from tests.geometry.shapes import as_solid, box, invert, join

KINDS = ("touching", "face on face", "overlapping", "nested", "apart")
GAPS = (1e-6, 1e-4, 1e-3, 0.01, 0.03)


def draw_parts(rng: np.random.Generator) -> tuple[list[Mesh], float]:
    """Two to four shells, any of them turned, and the volume that they bound."""
    size = np.array([40.0, 30.0, 20.0])
    bodies, cavities = [box(size)], []
    sides = rng.permutation([(0, 1), (0, -1), (2, 1), (2, -1)])
    for number in range(rng.integers(1, 4)):
        kind, (axis, sign) = rng.choice(KINDS), sides[number]
        at = np.zeros(3)
        if kind == "nested":
            at[0] = 4 * number - 6
            cavities.append(as_solid(trimesh.creation.icosphere(2, rng.uniform(1, 1.9)), at))
            continue
        other = np.where(np.arange(3) == axis, 6.0, size) if kind == "face on face" else rng.uniform(4, 9, 3)
        gap = {"overlapping": -rng.uniform(0.01, 2), "apart": rng.choice(GAPS)}.get(kind, 0.0)
        if kind != "face on face":
            at[:] = rng.uniform(-2, 2, 3)
        at[axis] = sign * ((size[axis] + other[axis]) / 2 + gap)
        bodies.append(box(other, at))
    whole = unite(bodies)
    for cavity in cavities:
        whole = subtract_lost(whole, unite([cavity]))
    shells = [invert(one) if rng.random() < 0.5 else one for one in (*bodies, *cavities)]
    return [shells[k] for k in rng.permutation(len(shells))], whole.volume()


def as_read_from_stl(vertices: Floats, faces: np.ndarray) -> tuple[Floats, np.ndarray]:
    """Each triangle with vertices of its own, in the digits of a file."""
    return vertices[faces].reshape(-1, 3).astype(np.float32).astype(float), np.arange(3 * len(faces)).reshape(-1, 3)


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(60))
def test_the_volume_is_right_whichever_way_the_shells_face(seed: int) -> None:
    shells, volume = draw_parts(np.random.default_rng(seed))
    vertices, faces = join(*shells)
    assert make_part(vertices, faces).volume == pytest.approx(volume, rel=1e-9)
    read = make_part(*as_read_from_stl(vertices, faces))
    assert read.volume == pytest.approx(volume, rel=1e-4)


def test_shells_tell_bodies_from_cavities_and_whether_any_touch() -> None:
    vertices, faces = join(box(20.0), box(8.0), invert(box(4.0, at=(40, 0, 0))))
    shells = Shells(vertices, faces, np.repeat([0, 1, 2], 12), np.array([True, True, False]))
    shells.relate(outward=False)
    assert shells.are_apart
    assert shells.should_face_out.tolist() == [True, False, True]


def test_components_of_links() -> None:
    label, count = label_components(np.array([0, 3]), np.array([2, 1]), 5)
    assert count == 3
    assert (label[0], label[1]) == (label[2], label[3])
