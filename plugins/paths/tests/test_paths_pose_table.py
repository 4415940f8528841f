"""Which tool axes are free along passes: the same as when every pose is looked at, with fewer looks."""

from __future__ import annotations

import numpy as np
import trimesh
from damageest_paths.clearance.axes import list_axes
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import Obstacles
from damageest_paths.clearance.pose_table import PoseTable
from damageest_paths.tool.nozzle import Cone, make_nozzle

from damageest.artefacts import Floats, Mesh

NEEDED, ROOM = 0.8, 1.2


class Counted(Clearance):
    """Counts the poses that it bounds."""

    asked = 0

    def bound(self, points: Floats, axes: Floats, needed: float) -> tuple[Floats, Floats]:
        type(self).asked += len(points)
        return super().bound(points, axes, needed)


def make_table() -> tuple[PoseTable, list[Floats], Floats, Clearance]:
    ball = trimesh.creation.icosphere(3, 8.0).apply_translation((6, 3, 12))
    mesh = Mesh(np.asarray(ball.vertices), np.asarray(ball.faces, np.int64))
    near = Obstacles([mesh], np.full(3, -20.0), np.full(3, 20.0), 2.0)
    Counted.asked = 0
    clearance = Counted(make_nozzle(Cone(1.0, 4.0, 30.0, np.radians(20))), 3.0, near)
    axes = list_axes(np.radians(60))
    lines = [
        np.column_stack([np.linspace(-20, 20, count), np.full(count, y), np.zeros(count)])
        for count, y in ((90, 3.0), (2, 0.0), (91, -6.0), (60, -25.0))
    ]
    return PoseTable(lines, axes, clearance, NEEDED, ROOM), lines, axes, clearance


def look_at_all(points: Floats, axes: Floats, clearance: Clearance) -> Floats:
    poses = np.repeat(points, len(axes), axis=0), np.tile(axes, (len(points), 1))
    return Clearance.bound(clearance, *poses, ROOM)[1].reshape(len(points), len(axes))


def test_an_axis_that_serves_all_along_is_found_with_fewer_looks() -> None:
    table, lines, axes, clearance = make_table()
    room = table.find_room()
    expected = np.array(
        [look_at_all(np.append(line[:-1:4], line[-1:], axis=0), axes, clearance).min(axis=0) for line in lines]
    )
    assert 0 < (expected >= NEEDED).sum() < expected.size
    assert np.array_equal(room >= NEEDED, expected >= NEEDED)
    assert np.array_equal(room >= ROOM, expected >= ROOM)
    assert Counted.asked < len(axes) * sum(len(line) for line in lines) / 4


def test_what_counts_as_free_is_free_and_little_else_is_left_out() -> None:
    table, lines, axes, clearance = make_table()
    table.find_room()
    left_out = total = 0
    for line, (low, high) in zip(lines, table.bound(range(len(lines))), strict=True):
        expected = look_at_all(np.append(line[:-1:2], line[-1:], axis=0), axes, clearance)
        assert (low <= high).all()
        assert not ((high >= NEEDED) & (expected < NEEDED)).any()
        left_out += int(((high < NEEDED) & (expected >= NEEDED)).sum())
        total += int((expected >= NEEDED).sum())
    assert left_out <= 0.02 * total
    assert Counted.asked < len(axes) * sum(len(line) for line in lines) / 2
