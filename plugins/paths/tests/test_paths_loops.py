"""The compiled distances: they hold for each shape of nozzle, and do not depend on what else is asked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import Obstacles
from damageest_paths.tool.nozzle import Cone, make_nozzle
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Floats, Mesh
from damageest.geometry.vectors import normalise
from tests.needs import import_or_skip

numba = import_or_skip("numba")
if TYPE_CHECKING:
    from damageest_paths.clearance import compiling
else:
    compiling = import_or_skip("damageest_paths.clearance.compiling")

CONES = {
    "nozzle": Cone(1.0, 4.0, 12.0, np.radians(20)),
    "pointed beam": Cone(0.0, 0.6, 6.0, np.radians(45)),
    "cylinder": Cone(2.0, 2.0, 8.0, np.radians(20)),
    "cone alone": Cone(0.5, 50.0, 6.0, np.radians(30)),
}
SHARES = np.random.default_rng(0).dirichlet([0.6] * 3, 400)
"""Places on a triangle, as shares of its corners."""


def make_clearance(triangles: Floats, cone: Cone, endless: bool) -> Clearance:
    mesh = Mesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    found = Clearance(make_nozzle(cone), 1.0, Obstacles([mesh], np.full(3, -5.0), np.full(3, 5.0), 4.0))
    return found if endless else found.during_travel()


def measure(clearance: Clearance, triangles: Floats, point: Floats, axis: Floats) -> float:
    """The distance by FCL, which knows surfaces only: 0 where a triangle has a place inside the nozzle."""
    away = np.einsum("sk,fki->fsi", SHARES, triangles).reshape(-1, 3) - point - clearance.standoff * axis
    height = away @ axis
    radius = np.linalg.norm(away - height[:, None] * axis, axis=1)
    profile = clearance.nozzle.profile
    assert profile is not None
    inside = (height > 0) & (height < profile[-1, 0]) & (radius < np.interp(height, *profile.T))
    return 0.0 if inside.any() else clearance.measure(point, axis)


@pytest.mark.slow
@pytest.mark.parametrize("cone", CONES.values(), ids=CONES)
@settings(deadline=None)  # the first call compiles
@given(seed=st.integers(0, 10**6), needed=st.floats(0.05, 3.0))
def test_the_true_distance_lies_between_the_bounds_for_each_shape(cone: Cone, seed: int, needed: float) -> None:
    """By FCL, among random triangles, large and small. A short nozzle has some of them behind it."""
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-12, 12, (6, 1, 3)) + rng.uniform(0.2, 8) * rng.normal(size=(6, 3, 3))
    clearance = make_clearance(triangles, cone, endless=False)
    points, axes = rng.uniform(-6, 6, (10, 3)), normalise(rng.normal(size=(10, 3)))
    low, high = clearance.bound(points, axes, needed)
    exact = np.array([measure(clearance, triangles, *pose) for pose in zip(points, axes, strict=True)])
    wide = 0.006 * max(cone.body_radius, cone.tip_radius + cone.length * np.tan(cone.angle))  # the mesh is in the solid
    assert (low <= exact + 1e-5).all()
    assert (high >= exact - wide - 1e-5).all()
    assert (high[exact < needed - wide] < 1.1 * needed).all()
    assert (low[exact > 1.1 * needed + wide] >= needed).all()


def test_poses_are_decided_alike_alone_and_together() -> None:
    """What is kept from one pose to the next saves time and decides nothing."""
    rng = np.random.default_rng(3)
    triangles = rng.uniform(-12, 12, (15, 1, 3)) + rng.normal(size=(15, 3, 3))
    clearance = make_clearance(triangles, CONES["nozzle"], endless=True)
    share = np.linspace(0, 1, 200)[:, None]
    points = (1 - share) * [-9, 2, -3] + share * [9, -1, 4]
    axes = normalise(rng.normal(size=(200, 3)) + np.array([0, 0, 3]))
    together = clearance.measure_poses(points, axes, 0.7)
    alone = [clearance.measure_poses(p[None], a[None], 0.7)[0] for p, a in zip(points, axes, strict=True)]
    assert 20 < (together < 0.7).sum() < 180
    assert ((together < 0.7) == (np.array(alone) < 0.7)).all()


def test_the_loops_are_compiled_where_no_folder_can_be_written(monkeypatch: pytest.MonkeyPatch) -> None:
    real: Any = numba.njit

    def refuse(*given: Any, cache: bool = False, **other: Any) -> Any:
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return real(*given, **other)

    monkeypatch.setattr(numba, "njit", refuse)

    def add(one: float, other: float) -> float:
        return one + other

    assert compiling.compile_loops(add)(1.0, 2.0) == 3.0


@compiling.compile_loops
def _double(value: float) -> float:
    return 2 * value


@compiling.compile_loops
def _double_and_add(value: float) -> float:
    return _double(value) + 1


def test_the_loops_run_where_the_disk_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    saved = []

    def refuse(*given: object) -> None:
        saved.append(given)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", refuse)
    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.load", lambda *given: None)
    assert compiling.run_loops(_double_and_add, 3.0) == 7.0
    assert len(saved) == 2
