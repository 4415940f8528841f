"""What preparation gains: ragged damages, opened before deposition, and how much of them a path reaches then."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from damageest_evaluate.damages import PlacePicker
from damageest_evaluate.rows import read_rows
from damageest_paths.layering.directions import find_open_normal
from damageest_paths.layers import Layers

from damageest.artefacts import Part, Solid
from damageest.errors import StageError
from damageest.geometry.remaining import subtract_from_part
from damageest.geometry.solids import to_manifold, to_solid
from damageest.geometry.vectors import normalise
from damageest.stages.allowance import Allowance
from damageest_benchmarks.parts import PARTS
from damageest_benchmarks.paths.others import make_lump
from damageest_benchmarks.paths.run import choose_options
from damageest_benchmarks.paths.scenes import Scene

OWN = ("block", "shaft", "lever", "cuboid", "coupling")
"""Parts that are damaged in turn."""
RADIUS = 0.04
"""Of the first lump, as a share of the part's diagonal."""
LUMPS, APART, LEAN = 5, 0.8, 40.0
"""Lumps of a damage, their distance in radii, and the largest angle (degrees) between their row and the skin's normal.
"""
WALL = 20.0
"""Angle of the walls of the opening, in degrees; the cutter's radius is the width of the bead."""
ATTEMPTS = 20


@dataclass(frozen=True)
class PrepareRow:
    """One damage. ``lost``: its volume; ``before``, ``after``: shares of what is to be deposited that the path reaches,
    without and with preparation; ``milled``: intact metal that is milled off, and ``convex``: what a convex cavity that
    is open straight up takes off, both as shares of ``lost``. ``why``: what is still not reached, and why."""

    name: str
    lost: float
    width: float
    before: float
    after: float
    milled: float
    convex: float
    why: str


def make_ragged(part: Part, seed: int) -> tuple[Any, Any]:
    """A part and what is lost of it, Manifolds about the part's middle: rough lumps in a row that leads into the part
    at a slant, each smaller than the one before. Raises LookupError where there is no place for them."""
    from manifold3d import Manifold, OpType

    rng = np.random.default_rng([4714, seed])
    picker = PlacePicker(part, rng)
    origin = part.bounds.mean(axis=0)
    body = to_manifold(part, origin)
    for _ in range(ATTEMPTS):
        point, normal = picker.pick_point()
        radius = RADIUS * part.diagonal
        aside = normalise(np.cross(normal, rng.normal(size=3))[None])[0]
        lean = np.radians(float(rng.uniform(0, LEAN)))
        way = -np.cos(lean) * normal + np.sin(lean) * aside
        lumps = []
        for number in range(LUMPS):
            place = point - origin + radius * (APART * number * way + 0.2 * rng.normal(size=3))
            size = radius * (1 - 0.12 * number)
            lumps.append(make_lump(rng, size).rotate(picker.draw_rotation()).translate(tuple(place)))
        lost = body ^ Manifold.batch_boolean(lumps, OpType.Add)
        pieces = sorted(lost.decompose(), key=lambda piece: -piece.volume())
        # not through the part, so that it is open to one side
        if pieces and pieces[0].volume() > 2 * radius**3 and (body - pieces[0]).genus() == body.genus():
            return body, pieces[0]
    raise LookupError("no ragged damage fits")


def evaluate_damage(name: str, part: Part, seed: int, milling: type[Any]) -> PrepareRow:
    """One row, with 3 axes along the normal of the open side, for the path and for the opening."""
    body, lost = make_ragged(part, seed)
    origin = part.bounds.mean(axis=0)
    damage, left = to_solid(lost, origin), to_solid(body - lost, origin)
    assert damage is not None
    assert left is not None
    scene = Scene("ragged", name, damage, left)
    options = choose_options(scene)
    width = float(str(options["width"]))
    tolerance = 0.05 * width
    direction = tuple(find_open_normal(damage, left, tolerance).tolist())
    options |= {"axes": 3, "direction": direction, "simulate": False, "layers": "planar"}
    stage = milling.model_validate({"prepare": {"min_radius": width, "wall_angle": WALL, "direction": direction}})
    deposit = stage.run(damage=damage, part=part, tolerance=tolerance, others=None)
    convex = (_open_convex(lost, direction) ^ body).volume() - lost.volume()
    before = Layers.model_validate(options).run(body=damage, left=left, built=None, tolerance=tolerance)
    assert before is not None
    after, why = before, ""
    if deposit is not None and deposit.cavity is not None:
        rest = subtract_from_part(part, [deposit.cavity], openings=[deposit.opening])
        planned = Layers.model_validate(options).run(
            body=Solid(deposit.vertices, deposit.faces), left=rest, built=None, tolerance=tolerance
        )
        assert planned is not None
        after = planned
    if after.unreached:
        most = max(after.unreached, key=lambda item: item.volume)
        why = f"{most.volume / after.deposit_volume:.1%} {most.why}"
    cut = 0.0 if deposit is None else deposit.cut_back_volume
    return PrepareRow(
        name, damage.volume, width, _reach(before), _reach(after), cut / damage.volume, convex / damage.volume, why
    )


def _open_convex(lost: Any, direction: Any) -> Any:
    """The hull of a body and of its shadow at its highest place along a direction (3,)."""
    from manifold3d import Manifold

    points = np.asarray(lost.to_mesh().vert_properties, dtype=np.float64)[:, :3]
    up = np.asarray(direction)
    height = points @ up
    raised = points + (height.max() - height)[:, None] * up
    return Manifold.hull_points(np.concatenate([points, raised]))


def _reach(path: Any) -> float:
    return 1 - float(path.unreached_volume) / float(path.deposit_volume)


def run_prepare(count: int, registry: Any, out: Path | None = None) -> Iterator[PrepareRow]:
    """The rows of ``count`` damages; those that are refused have no figures after. Rows that the file ``out`` has are
    taken from it, others are appended to it."""
    milling = registry.get(Allowance.stage, "milling").cls
    known = {row["name"]: PrepareRow(**row) for row in read_rows(out)}
    for seed in range(count):
        part = OWN[seed % len(OWN)]
        name = f"{part} {seed // len(OWN) + 1}"
        row = known.get(name)
        if row is None:
            try:
                row = evaluate_damage(name, PARTS[part](), seed, milling)
            except (StageError, LookupError) as error:
                nan = float("nan")
                row = PrepareRow(name, nan, nan, nan, nan, nan, nan, str(error))
            if out:
                with out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(row)) + "\n")
        yield row


def make_prepare_table(rows: Sequence[PrepareRow]) -> str:
    """A Markdown table: a line a damage, and one of the medians."""
    from damageest_evaluate.tables import format_markdown

    head = ["damage", "lost, mm³", "reached", "prepared", "milled", "convex", "of the convex"]
    lines = [head, *(_make_line(row.name, row) for row in rows)]
    known = [row for row in rows if np.isfinite(row.after)]
    if known:
        names = ("lost", "width", "before", "after", "milled", "convex")
        middle = {name: float(np.median([getattr(row, name) for row in known])) for name in names}
        lines.append(_make_line("median", PrepareRow("median", why="", **middle)))
    refused = [f"{row.name}: {row.why}" for row in rows if not np.isfinite(row.after)]
    return "\n\n".join([format_markdown(lines), *refused])


def _make_line(name: str, row: PrepareRow) -> list[str]:
    share = row.milled / row.convex if row.convex > 0 else float("nan")
    shares = [f"{value:.1%}" for value in (row.before, row.after)]
    return [name, f"{row.lost:.3g}", *shares, *(f"{value:.2f}" for value in (row.milled, row.convex, share))]
