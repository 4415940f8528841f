"""Whether an earlier and a later scan were laid on each other by a table that both show."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats, Part, Pose, Reason, Scan
from damageest.errors import StageError
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.solids import to_manifold, to_solid
from damageest.geometry.tables import Table, find_table
from damageest.geometry.transforms import move_points
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.state import JobState, Reasons
from damageest.stages.align import Align

SAMPLES = 20_000
NEAR = 3.0
"""Distance in tolerances within which a point lies on the table, or on the skin."""
EXPLAINED = 0.9
"""Share of what stands on the table that lies on the earlier scan in a right pose, of what that shows."""
BETTER = 0.1
"""Share by which more of it does without the table, for the table to be set aside."""
CONTRADICTED = 0.7
"""The same share below which the scans contradict the pose."""


def refit_without_table(engine: Engine, state: JobState, pose: Pose) -> tuple[Scan, Part, Pose, Reasons]:
    """Fits two scans of a part without the table that both show, where what stands on it does not agree in the pose
    with it; sets the table aside where more agrees then, and doubts the pose where both poses explain the scans."""
    scan, part, reach = state.scan, state.part, NEAR * state.tolerance
    assert part.unseen is not None  # an earlier scan stands for the part
    seen = np.flatnonzero(~part.unseen)
    skin = sample_by_area(part, SAMPLES, np.random.default_rng(0), seen)[0]
    below, under = find_table(skin, reach), find_table(scan.points, reach)
    if below is None or under is None:
        return scan, part, pose, ()
    body = scan.take(~under.find(scan.points, 2 * reach))
    bare = _cut_off(part, below, 2 * reach)
    if bare is None or not len(body.points):
        return scan, part, pose, ()
    explained = _measure_explained(body.points, pose, bare, reach)
    if explained >= EXPLAINED:
        return scan, part, pose, ()
    alone = state.with_value(JobState.scan, body, digest("without table", state.key("scan")))
    alone = alone.with_value(JobState.part, bare, digest("without table", state.key("part")))
    other: Pose | None = None
    with suppress(StageError):
        other = engine.make_silent().call(Align, alone).get(Align.gives)
    told = (
        f"both scans show a table; with one table laid on the other, {explained:.0%} of the objects on it agree with "
        "the earlier scan"
    )
    remedy = "crop the table away from both scans"
    better = 0.0 if other is None else _measure_explained(body.points, other, bare, reach)
    if other is None or better < explained + BETTER:
        if explained >= CONTRADICTED:
            return scan, part, pose, ()
        text = f"{told}, and without the tables no pose explains more"
        doubt = Reason("shared_table", text, "contradicts", explained, remedy=remedy)
        return scan, part, replace(pose, doubts=(*pose.doubts, doubt)), ()
    text = f"{told}, and in the pose without the tables {better:.0%}: the tables were set aside"
    return body, bare, other, [Reason("table_aside", text, amount=better, remedy=remedy)]


def _cut_off(part: Part, table: Table, near: float) -> Part | None:
    """What of an earlier scan stands on the table; None where nothing does."""
    assert part.unseen is not None
    height = table.offset + near
    solid = to_solid(to_manifold(part).trim_by_plane(table.normal.tolist(), height), np.zeros(3))
    if solid is None:
        return None
    middle = solid.triangles.mean(axis=1)
    unseen = part.unseen[closest_on_mesh(middle, part)[1]] | (middle @ table.normal < height + 1e-3 * near)
    return None if unseen.all() else replace(part, vertices=solid.vertices, faces=solid.faces, unseen=unseen)


def _measure_explained(points: Floats, pose: Pose, part: Part, reach: float) -> float:
    """Share of the points (N,3) of a scan that lie on the part, of those near skin that an earlier scan shows."""
    at = move_points(points[:: max(1, len(points) // SAMPLES)], pose.T_part_scan)
    distance, face, _ = closest_on_mesh(at, part)
    assert part.unseen is not None
    known = ~part.unseen[face]
    return float((distance[known] <= reach).mean()) * float(known.mean()) if known.any() else 0.0
