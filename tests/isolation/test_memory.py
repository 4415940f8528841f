"""Memory is foreseen: the estimates cover what is used, and too much is refused with both figures and a remedy."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from damageest.errors import InputError, StageError
from damageest.io import file_memory
from damageest.io.points import read_points
from damageest.isolation import memory
from tests.faults import seeds

SCRIPT = """
import ctypes, json, sys
import numpy as np, scipy.fft, scipy.sparse.csgraph, scipy.spatial, trimesh
from damageest.artefacts import DAMAGE, INTACT, Deviation, Mesh, Part, Scan, Sites
from damageest.trust.skin import skin_cells
from damageest.geometry import distance, distance_by_cells, local_fits, neighbourhoods, poisson, refinement
from damageest.stages.cluster import _density
from damageest.geometry import spreading as _spread
from damageest.stages.segment import _wear
from damageest_octree import octree

foreseen = []
modules = (
    distance, distance_by_cells, local_fits, neighbourhoods, poisson, refinement, _density, _spread, _wear, octree
)
for module in modules:
    module.require_memory = lambda needed, what, remedy: foreseen.append(needed)

def status(name):
    return next(int(line.split()[1]) * 1024 for line in open("/proc/self/status") if line.startswith(name))

def ball(count):
    points = np.random.default_rng(0).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)

def part(subdivisions):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    part = Part(mesh.vertices, mesh.faces, "mm")
    part.cross, part.face_normals, part.triangles
    return part

def solve():
    points = ball(50_000)
    grid = poisson.make_grid(np.full(3, -1.4), np.full(3, 1.4), 2.8 / 120)
    return lambda: poisson.solve_coarse_to_fine(grid, points, points, np.full(50_000, 4 * np.pi / 50_000), 4.0)

def refine():
    ball = part(5)
    return lambda: refinement.halve_edges(Mesh(ball.vertices, ball.faces), 0.008)

def skin():
    ball = part(7)
    return lambda: skin_cells.cut_skin(ball, 0.0001)

def measure_points():
    points, to = ball(300_000), part(4)
    return lambda: distance.signed_distance(points, to)

def measure_triangles():
    points, to = ball(1000), part(7)
    return lambda: distance.signed_distance(points, to)

def measure_cells():
    points, to = ball(700_000) * 1.0005, part(3)
    return lambda: distance_by_cells.signed_distance_by_cells(
        points, to, 0.05, lambda some: distance.signed_distance(some, to)
    )

def neighbours():
    points = ball(300_000)
    return lambda: neighbourhoods.find_neighbours(points, 12)

def nearest():
    points, among = ball(20_000), ball(3_000_000)
    return lambda: neighbourhoods.find_neighbours(points, 1, among)

def fits():
    points = ball(30_000)
    return lambda: local_fits.average_points(points, np.ones(30_000, np.int64), 0.0005, np.arange(0, 30_000, 20))

def density():
    points = ball(100_000)
    return lambda: _density.run_dbscan(points, 4 * np.sqrt(4 * np.pi / 100_000), 10)

def spread():
    triangles = part(4).triangles
    return lambda: _spread.spread_points(triangles, np.arange(len(triangles)), 0.004)

def thin():
    triangles = part(4).triangles
    points = _spread.spread_points(triangles, np.arange(len(triangles)), 0.006)[0]
    return lambda: _spread.thin(points, 0.014, 0.014)

def wear():
    points, to, rng = ball(700_000), part(4), np.random.default_rng(1)
    scan = Scan(points, noise=0.001, spacing=0.004)
    away, face = rng.normal(size=len(points)) * 0.001, rng.integers(0, len(to.faces), len(points))
    return lambda: _wear.find_wear(scan, to, away, face, 0.01)

def cells():
    points, to = ball(100_000), part(4)
    away = -np.maximum(points[:, 2] - 0.7, 0)
    label = np.where(away < -0.01, DAMAGE, INTACT).astype(np.uint8)
    aligned = Scan(points * (1 + away)[:, None], noise=0.001, spacing=0.01)
    deviation, sites = Deviation(away, np.zeros(len(points), np.int64), label), Sites((label == DAMAGE).astype(int), 1)
    return lambda: octree.Octree(cell=0.015).run(to, aligned, deviation, sites, 0.015)

trim = ctypes.CDLL("libc.so.6").malloc_trim
for make in [globals()[name] for name in sys.argv[1:]]:
    call = make()
    trim(0)
    open("/proc/self/clear_refs", "w").write("5")
    before = status("VmRSS")
    call()
    # what the distances by cells take stands beside what the exact ones take
    total = foreseen[0] + max(foreseen[1:], default=0) if make is measure_cells else max(foreseen)
    print(json.dumps([make.__name__, total, status("VmHWM") - before]))
    foreseen.clear()
    del call
"""
SOME = ("measure_points",)
WHAT = (
    "solve", "refine", "skin", "measure_points", "measure_triangles", "measure_cells", "neighbours", "nearest", "fits",
    "density", "spread", "thin", "wear", "cells",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("what", [SOME, pytest.param(WHAT, marks=pytest.mark.slow)])
def test_an_estimate_is_right_within_a_factor_of_two(what: tuple[str, ...]) -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT, *what], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [name for name, _, _ in rows] == list(what)
    assert min(used for _, _, used in rows) > 30e6
    assert not [(name, foreseen / 1e6, used / 1e6) for name, foreseen, used in rows if not 0.5 < foreseen / used < 2]


def test_too_much_is_refused_with_both_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "measure_free_memory", lambda: 3 * 10**9)
    memory.require_memory(2.9e9, "a grid", "a larger tolerance")
    with pytest.raises(
        StageError, match=r"would need about 3\.1 GB of memory for a grid, but 3 GB are free"
    ) as refused:
        memory.require_memory(3.1e9, "a grid", "a larger tolerance")
    assert "try: a larger tolerance" in str(refused.value)


def test_the_limit_of_the_process_counts() -> None:
    """As --memory and ``ulimit -v`` set it."""
    script = (
        "import resource; from damageest.isolation.memory import require_memory\n"
        "resource.setrlimit(resource.{}, (600 * 10**6,) * 2)\n"
        "require_memory(1e8 + 1, 'little', ''); require_memory(7e8, 'much', '')"
    )
    for name in ("RLIMIT_DATA", "RLIMIT_AS"):
        done = subprocess.run([sys.executable, "-c", script.format(name)], capture_output=True, text=True)
        assert "would need about 700 MB of memory for much" in done.stderr
        assert "for little" not in done.stderr


def test_a_file_that_does_not_fit_is_refused_before_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "scan.ply"
    path.write_bytes(seeds.seed("little.ply"))
    monkeypatch.setattr(memory, "measure_free_memory", lambda: 10_000)
    assert len(read_points(path).points) == seeds.POINTS, "little is not asked for"
    monkeypatch.setattr(memory, "WORTH_ASKING", 1000)
    with pytest.raises(InputError, match=r"scan\.ply: would need about .* are free\n  try: a machine with more memory"):
        read_points(path)
    assert set(file_memory.TIMES) >= {".ply", ".e57", ".laz", ".3mf"}
