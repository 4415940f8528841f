"""Parts whose model is wrong, coarse or turned inside out."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Mesh, Part
from damageest.geometry.solids import to_arrays, to_solid
from damageest.io.meshes import write_stl
from damageest.io.parts import read_part
from damageest_benchmarks.families.scene import Draw, to_part
from damageest_benchmarks.reported.bench import Bench, take


def _read_again(mesh: Mesh) -> Part:
    """The part as a file of the mesh is read."""
    with tempfile.TemporaryDirectory(prefix="damageest-reported-") as folder:
        path = Path(folder) / "part.stl"
        write_stl(path, mesh)
        return read_part(path, "mm")


def coarse_facets() -> Draw:
    """The CAD of a shaft was saved with sixteen facets a turn, and the scan is round."""
    from manifold3d import CrossSection, Manifold

    profile = [(0, -40), (12, -40), (12, -10), (18, -10), (18, 20), (10, 20), (10, 40), (0, 40)]
    section = CrossSection([np.array(profile, dtype=np.float64)])
    flat = Manifold.cube((20, 40, 10), True).translate((18, 0, 35))
    coarse, fine = (Manifold.revolve(section, count) - flat for count in (16, 256))
    chip = Manifold.sphere(6, 64).translate((0, -18, 20))
    part = to_part(Mesh(*to_arrays(coarse)), "shaft")
    bench = Bench(part, Mesh(*to_arrays(fine - chip)), to_solid(coarse ^ chip), 80)
    return bench.finish(bench.scan()[0])


def _with_faces(seed: int, flipped: float) -> Draw:
    bench = take("block", seed)
    faces = bench.part.faces.copy()
    turned = bench.rng.random(len(faces)) < flipped
    faces[turned] = faces[turned][:, ::-1]
    draw = bench.finish(bench.scan()[0])
    return replace(draw, part=_read_again(Mesh(bench.part.vertices, faces)))


def triangles_not_oriented() -> Draw:
    """A closed model half of whose triangles are the wrong way round."""
    return _with_faces(81, 0.5)


def model_inside_out() -> Draw:
    """All triangles face inward: differences of such solids are empty elsewhere."""
    return _with_faces(82, 1.1)


def sawtooth_on_round_edges() -> Draw:
    """The model's rounded edge is meshed in ridges of one and a half tolerances, and the part's is smooth."""
    from manifold3d import CrossSection, Manifold

    turn = np.linspace(0, np.pi / 2, 9)
    round_edge = np.column_stack([21 + 5 * np.cos(turn), 15 + 5 * np.sin(turn)])
    profile = np.concatenate([[(0, -20), (26, -20)], round_edge, [(0, 20)]])
    flat = Manifold.cube((10, 60, 60), True).translate((-27, 0, 0))
    smooth: Any = Manifold.revolve(CrossSection([profile]), 128)
    tolerance = 0.1

    def ridge(at: np.ndarray) -> np.ndarray:
        radius = np.linalg.norm(at[:, :2], axis=1)
        edge = (at[:, 2] > 15.1) & (radius > 21.1)
        number = np.round(np.arctan2(at[:, 1], at[:, 0]) / (2 * np.pi / 128)).astype(int)
        at[:, 2] += np.where(edge, 0.75 * tolerance * (1 - 2 * (number % 2)), 0.0)
        return at

    model = smooth.warp_batch(ridge) - flat
    chip = Manifold.sphere(6, 64).translate((0, 26, -20))
    part = to_part(Mesh(*to_arrays(model)), "round edge")
    bench = Bench(part, Mesh(*to_arrays(smooth - flat - chip)), to_solid(model ^ chip), 83)
    return bench.finish(bench.scan()[0])


def model_not_closed() -> Draw:
    """The model lacks a few triangles, and its volume is not what a program says."""
    bench = take("block", 84)
    draw = bench.finish(bench.scan()[0])
    return replace(draw, part=_read_again(Mesh(bench.part.vertices, bench.part.faces[:-3])))
