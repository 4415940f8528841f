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
from damageest.isolation import foresee
from tests.faults import seeds

SCRIPT = """
import json, os, sys
import numpy as np, scipy.fft, scipy.sparse, trimesh
from damageest.artefacts import Mesh
from damageest.geometry import poisson, refinement
foreseen = []
poisson.require_memory = refinement.require_memory = lambda needed, what, remedy: foreseen.append(needed)

def status(name):
    return next(int(line.split()[1]) * 1024 for line in open("/proc/self/status") if line.startswith(name))

def solve():
    points = np.random.default_rng(0).normal(size=(50_000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    grid = poisson.make_grid(np.full(3, -1.4), np.full(3, 1.4), 2.8 / 120)
    poisson.solve_coarse_to_fine(grid, points, points, np.full(50_000, 4 * np.pi / 50_000), 4.0)

def refine():
    ball = trimesh.creation.icosphere(subdivisions=5)
    refinement.halve_edges(Mesh(ball.vertices, ball.faces), 0.008)

open("/proc/self/clear_refs", "w").write("5")
before = status("VmRSS")
{"solve": solve, "refine": refine}[sys.argv[1]]()
print(json.dumps([max(foreseen), status("VmHWM") - before]))
"""


@pytest.mark.parametrize("what", ["solve", "refine"])
def test_an_estimate_covers_what_is_used(what: str) -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT, what], capture_output=True, text=True, check=True)
    foreseen, used = json.loads(done.stdout)
    assert used > 50e6
    assert 0.8 * used < foreseen < 4 * used


def test_too_much_is_refused_with_both_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(foresee, "measure_free_memory", lambda: 3 * 10**9)
    foresee.require_memory(2.9e9, "a grid", "a larger tolerance")
    with pytest.raises(
        StageError, match=r"would need about 3\.1 GB of memory for a grid, but 3 GB are free"
    ) as refused:
        foresee.require_memory(3.1e9, "a grid", "a larger tolerance")
    assert "try: a larger tolerance" in str(refused.value)
    monkeypatch.setattr(foresee, "measure_free_memory", lambda: None)
    foresee.require_memory(1e15, "a grid on a system that tells nothing", "")


def test_the_limit_of_the_process_counts() -> None:
    """As --memory and ``ulimit -v`` set it."""
    script = (
        "import resource; from damageest.isolation.foresee import require_memory\n"
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
    monkeypatch.setattr(foresee, "measure_free_memory", lambda: 10_000)
    assert len(read_points(path).points) == seeds.POINTS, "little is not asked for"
    monkeypatch.setattr(foresee, "WORTH_ASKING", 1000)
    with pytest.raises(InputError, match=r"scan\.ply: would need about .* are free\n  try: a machine with more memory"):
        read_points(path)
    assert set(file_memory.TIMES) >= {".ply", ".e57", ".laz", ".3mf"}
