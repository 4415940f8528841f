"""Few rows of points and triangles, and calls with them that need more than a line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Deviation, Floats, Ints, Mesh, Part, Scan, Surface
from damageest.geometry import (
    contour,
    crops,
    distance,
    distance_by_cells,
    neighbourhoods,
    orientation,
    pieces,
    poisson,
    rays,
    refinement,
    sampling,
    selectors,
    threads,
    vectors,
    voxels,
)
from tests.geometry.shapes import box

CUBE = box(10.0)
PART = Part(CUBE.vertices, CUBE.faces)
GRID = poisson.Grid(np.full(3, -10.0), 1.5, (16, 16, 16))


@dataclass(frozen=True)
class Rows:
    """``points`` (N,3) and ``mesh`` of M triangles, N and M from 0 to 2; ``rng`` for what else is needed."""

    points: Floats
    mesh: Mesh
    rng: np.random.Generator

    @property
    def count(self) -> int:
        return len(self.points)

    @property
    def normals(self) -> Floats:
        """(N,3) unit vectors."""
        return vectors.normalise(self.rng.normal(size=(self.count, 3)))

    @property
    def ones(self) -> Floats:
        return np.ones(self.count)

    @property
    def numbers(self) -> Ints:
        return self.rng.integers(0, 3, self.count)

    @property
    def scan(self) -> Scan:
        return Scan(self.points)

    @property
    def deviation(self) -> Deviation:
        return Deviation(self.ones, np.zeros(self.count, np.int64), self.numbers)

    @property
    def part(self) -> Part:
        """The cube with numbers of CAD faces."""
        return Part(CUBE.vertices, CUBE.faces, faces_brep=np.arange(12), face_kinds=("plane",) * 12)


def expect(found: Any, *shapes: tuple[int | None, ...]) -> None:
    """That an array, or each of several, has a shape, in which None is any number, and finite numbers."""
    every = found if isinstance(found, tuple) else (found,)
    assert len(every) == len(shapes)
    for array, shape in zip(every, shapes, strict=True):
        assert array.ndim == len(shape)
        assert all(wanted in (None, size) for size, wanted in zip(array.shape, shape, strict=True))
        assert array.dtype == bool or np.isfinite(array).all()


def expect_near(found: Any, count: int, columns: int) -> None:
    """Distances and indices of neighbours (count,columns)."""
    expect(found, (count, columns), (count, columns))


def call_threads(rows: Rows) -> None:
    found = threads.map_in_threads(lambda own: rows.points[own].sum(), threads.cut_evenly(rows.count, 1))
    assert len(found) == max(rows.count, 1)


def call_refine_at(rows: Rows) -> None:
    face, foot = refinement.find_nearest(CUBE, rows.points)
    refined, of_point = refinement.refine_at(CUBE, face, foot, 4.0)
    expect(of_point, (rows.count,))
    assert len(refined.faces) >= 12


def call_insert_points(rows: Rows) -> None:
    face, foot = refinement.find_nearest(CUBE, rows.points)
    _, vertex = refinement.insert_points(CUBE, face, foot)
    expect(vertex, (rows.count,))


def call_rays(rows: Rows) -> None:
    caster = rays.RayCaster(CUBE)
    expect(caster.find_first(rows.points, rows.normals)[1], (rows.count,))
    found = caster.find_crossings(rows.points - 30, rows.points + 30)
    assert len(found.ray) == len(found.face) == len(found.distance) == len(found.enters)
    expect(rays.RayCaster(rows.mesh).find_first(rows.points, rows.normals)[1], (rows.count,))


def call_join_pieces(rows: Rows) -> None:
    some = [pieces.Piece(box(4.0, (10.0 * k, 0, 0)), (k,)) for k in range(rows.count)]
    assert len(pieces.join_pieces(some)) == rows.count


def call_selector(rows: Rows) -> None:
    parents = rows.numbers
    for given in (
        {"box": [[-9, -9, -9], [9, 9, 9]]},
        {"faces": [0]},
        {"kind": "plane"},
        {"facing": {"direction": [0, 0, 1]}},
    ):
        chosen = selectors.Selector.model_validate(given)
        expect(chosen.matches(rows.points, rows.normals, parents, rows.part), (rows.count,))


def call_crops(rows: Rows) -> None:
    for crop in (
        crops.BoxCrop(keep="box", min=(-99, -99, -99), max=(99, 99, 99)),
        crops.CylinderCrop(keep="cylinder", point=(0, 0, -99), axis=(0, 0, 1), radius=99, length=999),
        crops.AboveCrop(keep="above", point=(0, 0, -99)),
        crops.PieceCrop(keep="largest piece"),
        crops.PieceCrop(keep="largest piece", gap=1.0),
    ):
        expect(crop.contains(rows.points), (rows.count,))


def call_crop_points(rows: Rows) -> None:
    everything = crops.AboveCrop(keep="above", point=(0, 0, -1e9))
    assert len(crops.crop_points(rows.scan, []).points) == rows.count
    assert len(crops.crop_points(rows.scan, [everything]).points) == rows.count


def call_grid(rows: Rows) -> None:
    expect(GRID.contains(rows.points), (rows.count,))
    expect(GRID.find_corners(rows.points), (rows.count, 8), (rows.count, 8))


def call_voxel_grid(rows: Rows) -> None:
    grid = voxels.VoxelGrid(np.full(3, -20.0), 5.0, np.array([8, 8, 8]))
    expect(grid.number_cells(rows.points), (rows.count,))
    expect(grid.mark_around(np.clip(rows.points, -9, 9), 1), (512,))


def call_fit_contour(rows: Rows) -> None:
    def closest(points: Floats) -> tuple[Floats, Floats]:
        found = distance.closest_on_mesh(points, CUBE)
        return found.distance, found.place

    found = contour.fit_contour(box(12.0), closest, 1.0, 0.1, lambda points, _: np.zeros(len(points), bool))
    assert len(found.faces)


def call_extract_contour(rows: Rows) -> None:
    found = contour.extract_contour(
        lambda points: distance.signed_distance(points, CUBE)[0], np.full(3, -8.0), (9, 9, 9), 2.0
    )
    assert len(found.faces)


def call_tree(rows: Rows) -> None:
    expect(tuple(distance.SurfaceTree(CUBE).closest(rows.points)), (rows.count,), (rows.count,), (rows.count, 3))
    expect(tuple(distance.SurfaceTree(rows.mesh).closest(rows.points)), (rows.count,), (rows.count,), (rows.count, 3))


def call_neighbours(rows: Rows) -> None:
    for count in (1, 3):
        expect_near(neighbourhoods.find_neighbours(rows.points, count), rows.count, min(count, rows.count))
        expect_near(neighbourhoods.find_neighbours(CUBE.vertices, count, rows.points), 8, min(count, rows.count))


def call_query(rows: Rows) -> None:
    expect_near(neighbourhoods.query_neighbours(neighbourhoods.make_tree(CUBE.vertices), rows.points, 3), rows.count, 3)
    expect_near(neighbourhoods.query_neighbours(neighbourhoods.make_tree(rows.points), CUBE.vertices, 0), 8, 0)


def call_gather(rows: Rows) -> None:
    found = neighbourhoods.gather_around(rows.points, CUBE.vertices, 2, rows.rng)
    assert len(found) <= rows.count
    found = neighbourhoods.gather_around(CUBE.vertices, rows.points, 2, rows.rng)
    assert len(found) <= 8


def call_sampling(rows: Rows) -> None:
    for count in (0, 2):
        expect(sampling.sample_by_area(rows.mesh, count, rows.rng), (count, 3), (count,))
        expect(sampling.sample_by_area(CUBE, count, rows.rng, np.arange(rows.count)), (count, 3), (count,))


def call_signed(rows: Rows) -> None:
    expect(distance.signed_distance(rows.points, CUBE), (rows.count,), (rows.count,))
    expect(distance.signed_distance(rows.points, rows.mesh), (rows.count,), (rows.count,))


def call_by_cells(rows: Rows) -> None:
    def exact(points: Floats) -> tuple[Floats, Ints]:
        return distance.signed_distance(points, CUBE)

    expect(distance_by_cells.signed_distance_by_cells(rows.points, CUBE, 0.5, exact), (rows.count,), (rows.count,))


def call_orientation(rows: Rows) -> None:
    none = np.empty((0, 3))
    args = rows.points, rows.normals, rows.normals
    expect(orientation.turn_toward_void(*args, none, none, np.empty(0), 0.5), (rows.count, 3))
    expect(
        orientation.turn_toward_void(*args, CUBE.vertices, vectors.normalise(CUBE.vertices), np.ones(8), 0.5),
        (rows.count, 3),
    )


def call_poisson(solve: Callable[..., Any]) -> Callable[[Rows], None]:
    return lambda rows: expect(solve(GRID, rows.points, rows.normals, rows.ones, 1.0), GRID.shape)


def call_both(function: Callable[..., Any], *more: Any) -> Callable[[Rows], None]:
    """Points against a mesh that is whole, and against few triangles."""

    def call(rows: Rows) -> None:
        expect(function(rows.points, CUBE, *more), (rows.count,))
        expect(function(rows.points, rows.mesh, *more), (rows.count,))

    return call


def surface(rows: Rows) -> Surface:
    return Surface(rows.mesh.vertices, rows.mesh.faces)
