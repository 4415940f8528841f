"""Two scans of one part, with a known loss between them: what is found, in another pose and with partial overlap."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from damageest_evaluate.processes import Row
from damageest_evaluate.tables import describe_measurement, format_markdown

from damageest.artefacts import Flags, Floats
from damageest.errors import DamageestError, InputError, StageError, describe_error
from damageest.geometry.solids import to_arrays
from damageest.geometry.vectors import cross_corners, normalise
from damageest.io.digests import digest
from damageest.result import Result

Outcome = Literal["right", "said", "silent"]
GRAZING = 0.25
"""Cosine of the angle between a scanner's axis and a normal below which it sees no skin."""


def _make_shaft() -> Any:
    from manifold3d import Manifold

    body = Manifold.cylinder(60, 12, 12, 128, True) + Manifold.cylinder(24, 17, 17, 128).translate((0, 0, -6))
    return (
        body
        - Manifold.cube((6, 6, 26), True).translate((12, 0, -24))
        - Manifold.cube((8, 12, 9), True).translate((-16, 10, -4))
    )


def _make_block() -> Any:
    from manifold3d import Manifold

    body = Manifold.cube((40, 30, 20), True) + Manifold.cylinder(20, 6, 6, 64).translate((8, 3, 5))
    return body + Manifold.cube((8, 30, 8), True).translate((-16, 0, 12))


def _make_bracket() -> Any:
    from manifold3d import Manifold

    body = Manifold.cube((50, 32, 8), True) + Manifold.cube((8, 32, 34), True).translate((-21, 0, 15))
    holes = [(4, (8, 6, 0)), (3, (16, -8, 0))]
    for radius, at in holes:
        body -= Manifold.cylinder(20, radius, radius, 64, True).translate(at)
    return body


PARTS: dict[str, Callable[[], Any]] = {"shaft": _make_shaft, "block": _make_block, "bracket": _make_bracket}
Views = tuple[tuple[float, float, float], ...]
ROUND: Views = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
"""Directions from which all of the skin is seen."""


@dataclass(frozen=True)
class Pair:
    """What happened between two scans. ``loss`` and ``gain``: kind, sizes and place of what was removed and added.
    ``before``, ``after``: directions from which each scan sees; ``first``, ``second``: its points,
    those not seen among them, and their noise. ``hidden``: the loss lies where the earlier scan sees nothing.
    ``shown``: the part that the later scan shows; empty: the same."""

    name: str
    part: str
    loss: tuple[Any, ...] = ()
    gain: tuple[Any, ...] = ()
    before: Views = ROUND
    after: Views = ROUND
    first: tuple[int, float] = (60_000, 0.03)
    second: tuple[int, float] = (60_000, 0.03)
    scale: float = 1.0
    shown: str = ""
    hidden: bool = False
    has_normals: bool = True


TOP: Views = ((0, 0, 1), (0.8, 0, 0.6), (-0.8, 0, 0.6), (0, 0.8, 0.6))
EARLY: Views = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
LATE: Views = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1))
OTHER: Views = ((1, 0, 0), (0, 0, 1), (0, -1, 0), (0, 0, -1))
FRONT: Views = ((0, -1, 0), (0.8, -0.6, 0), (-0.8, -0.6, 0))
SIDE: Views = ((0.6, -0.8, 0), (0.9, 0.2, 0.3), (0.2, -0.9, -0.3))
"""Directions from which some of the sides are seen."""
COMMON = {"cluster", "earlier_scan", "scraps", "speck"}
"""Codes that say nothing of an outcome."""
BALL, BOX = "ball", "box"
COARSE = (15_000, 0.08)
"""Points of a scan before those that were not seen are left out, and their noise in mm."""
PAIRS: tuple[Pair, ...] = (
    Pair("nothing changed", "block"),
    Pair("nothing changed, partial", "bracket", before=EARLY, after=LATE),
    Pair("nothing changed, less in common", "bracket", before=EARLY, after=OTHER),
    Pair("nothing changed, partial, no normals", "shaft", before=FRONT, after=SIDE, has_normals=False),
    Pair("nothing changed, sparse and noisy", "block", before=EARLY, after=OTHER, second=(20_000, 0.08)),
    Pair("nothing changed, noisy before", "bracket", first=(25_000, 0.08)),
    Pair("chip at a corner", "block", (BALL, 5, (20, 15, 10))),
    Pair("chip at a corner, partial", "block", (BALL, 5, (20, 15, 10)), before=EARLY, after=LATE),
    Pair("chip at a corner, less in common", "block", (BALL, 5, (20, 15, 10)), before=EARLY, after=OTHER),
    Pair("chip at an edge", "bracket", (BALL, 4, (25, 2, 4)), after=TOP),
    Pair("chip at an edge, partial", "bracket", (BALL, 4, (25, 2, 4)), before=EARLY, after=OTHER),
    Pair("chip, no normals after", "bracket", (BALL, 4, (25, -6, 4)), before=EARLY, after=LATE, has_normals=False),
    Pair("chip, sparse and noisy after", "block", (BALL, 5, (20, -15, 10)), before=TOP, after=TOP, second=COARSE),
    Pair("chip, sparse and noisy before", "block", (BALL, 5, (20, -15, 10)), after=TOP, first=COARSE),
    Pair("notch in a collar", "shaft", (BOX, (10, 10, 6), (0, -17, 15))),
    Pair("notch in a collar, partial", "shaft", (BOX, (10, 10, 6), (0, -17, 15)), before=FRONT, after=SIDE),
    Pair("hollow in a face", "block", (BALL, 14, (-2, -6, 23.0)), before=TOP, after=TOP),
    Pair("flat wear, 0.6 deep", "bracket", (BOX, (18, 20, 2), (14, -2, 4.4)), before=EARLY, after=OTHER),
    Pair("seat worn on one side, 0.7 deep", "shaft", (BOX, (24, 4, 16), (0, -13.3, -20)), before=FRONT, after=SIDE),
    Pair("two chips, partial", "block", ("two", 4, (20, 15, 10), (20, -15, 10)), before=EARLY, after=LATE),
    Pair("broken corner", "bracket", (BOX, (16, 16, 20), (25, 16, 0)), before=EARLY, after=LATE),
    Pair("weld bead", "block", gain=(BALL, 3, (-4, -8, 10)), before=TOP, after=TOP),
    Pair("weld bead and chip", "bracket", (BALL, 4, (25, 2, 4)), (BALL, 3, (-4, -8, 4)), before=TOP, after=TOP),
    Pair("loss that the earlier scan lacks", "block", (BALL, 5, (20, -15, -10)), (), TOP, FRONT + LATE, hidden=True),
    Pair("scan 1 % too large", "block", (BALL, 5, (20, 15, 10)), before=TOP, after=TOP + LATE, scale=1.01),
    Pair("later scan in inches", "block", (BALL, 5, (20, 15, 10)), scale=1 / 25.4),
    Pair("wrong part", "block", shown="bracket"),
    Pair("wrong part, partial", "bracket", before=EARLY, after=OTHER, shown="shaft"),
    Pair("no skin in common", "block", before=((0, 0, 1),), after=((0, 0, -1),)),
)  # fmt: skip


@dataclass(frozen=True)
class DifferenceCase:
    """One pair. ``source``: digest of the code."""

    pair: Pair
    seed: int
    source: str = ""
    varied: Mapping[str, float | str] = field(default_factory=dict)

    def compute_key(self) -> str:
        return digest("difference", str(self.pair), self.seed, self.source)

    def make_blank_row(self) -> Row:
        row: Row = {"key": self.compute_key(), "name": self.pair.name, "part": self.pair.part, "seed": self.seed}
        row |= {"varied": dict(self.varied), "true": 0.0, "overlap": 0.0, "found": 0.0, "interval": None, "gain": 0.0}
        return row | {"outcome": "", "why": "", "level": "", "error": "", "seconds": 0.0}

    def run(self) -> Row:
        """The row with what was found against the truth."""
        import damageest

        drawn = draw_pair(self.pair, self.seed)
        row = self.make_blank_row() | {"true": drawn.lost, "overlap": drawn.overlap, "true_gain": drawn.gained}
        start = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            np.save(Path(folder) / "before.npy", drawn.before)
            np.save(Path(folder) / "after.npy", drawn.after)
            part = {"use": "earlier_scan", "path": f"{folder}/before.npy"}
            job = {"version": 1, "part": part, "scan": f"{folder}/after.npy", "report": "none"}
            try:
                result = damageest.run(job)
            except (StageError, InputError) as error:
                text = describe_error(error).replace(folder, "")
                return row | {"outcome": "said", "why": text, "seconds": time.process_time() - start}
            except DamageestError as error:
                return row | {"error": describe_error(error)}
        return row | self._compare(result, drawn.lost) | {"seconds": time.process_time() - start}

    def _compare(self, result: Result, lost: float) -> Row:
        low, high = result.volume_95 or (0.0, math.inf)
        accepted = [site for site in result.sites if site.accepted]
        named = [site for site in result.sites if site.verdict.level == "doubtful"]
        told = {note.code for note in result.warnings} | {r.code for s in named for r in s.verdict.reasons}
        codes = sorted(told - COMMON)
        inside = low <= lost <= high and (not accepted or lost > 0) and (lost == 0 or bool(accepted))
        wrong_is_said = bool(named) or result.volume_95 is None or result.status != "ok"
        if lost == 0:  # nothing is to be found, and nothing to be doubted
            inside = not accepted and not named
        if self.pair.shown:
            inside = False
            wrong_is_said |= "another_part" in codes
        outcome: Outcome = "right" if inside else "said" if wrong_is_said else "silent"
        gain = sum(one.volume or one.estimate for one in result.surplus)
        return {
            "found": result.damage_volume, "interval": [low, high if math.isfinite(high) else None], "gain": gain,
            "outcome": outcome, "why": ", ".join(codes), "level": ", ".join(site.verdict.level for site in accepted),
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class DrawnPair:
    """Points and normals of both scans (N,6), the lost and the gained volume, and the share of the later scan's skin
    that the earlier one sees."""

    before: Floats
    after: Floats
    lost: float
    gained: float
    overlap: float


def draw_pair(pair: Pair, seed: int) -> DrawnPair:
    """Both scans, each in a frame of its own."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(seed)
    body = PARTS[pair.part]()
    left, lost, gained = body, 0.0, 0.0
    for tool in _make_tools(pair.loss):
        lost += (left ^ tool).volume()
        left -= tool
    for tool in _make_tools(pair.gain):
        gained += (tool - left).volume()
        left += tool
    if pair.shown:
        left = PARTS[pair.shown]()
    first = _scan(body, pair.before, *pair.first, rng)
    second = _scan(left, pair.after, *pair.second, rng)
    overlap = float(_is_seen(second[:, 3:], pair.before).mean())
    turns = Rotation.random(2, random_state=seed)
    frames = [turn.as_matrix() for turn in turns]
    before, after = (
        np.hstack([one[:, :3] @ R.T, one[:, 3:] @ R.T]) for one, R in zip((first, second), frames, strict=True)
    )
    after[:, :3] = pair.scale * (after[:, :3] + rng.uniform(-80, 80, 3))
    return DrawnPair(before, after if pair.has_normals else after[:, :3], 0.0 if pair.hidden else lost, gained, overlap)


def _make_tools(told: tuple[Any, ...]) -> list[Any]:
    from manifold3d import Manifold

    if not told:
        return []
    kind, size, *places = told
    made = Manifold.cube(size, True) if kind == BOX else Manifold.sphere(size, 64)
    return [made.translate(place) for place in places]


def _scan(body: Any, views: Views, count: int, noise: float, rng: np.random.Generator) -> Floats:
    """Points and normals (N,6) of the skin that is seen from some directions."""
    vertices, faces = to_arrays(body)
    corners = vertices[faces]
    cross = cross_corners(corners)
    area = np.linalg.norm(cross, axis=1)
    face = rng.choice(len(area), count, p=area / area.sum())
    first, second = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1 - first, first * (1 - second), first * second], axis=1)
    points, normals = np.einsum("nk,nkj->nj", weights, corners[face]), (cross / area[:, None])[face]
    seen = _is_seen(normals, views)
    points, normals = points[seen], normals[seen]
    return np.hstack([points + rng.normal(scale=noise, size=points.shape), normals])


def _is_seen(normals: Floats, views: Views) -> Flags:
    axes = normalise(np.array(views, float))
    return np.asarray((normals @ axes.T).max(axis=1) > GRAZING)


def make_difference_cases(seeds: Sequence[int], names: Sequence[str], source: str) -> list[DifferenceCase]:
    """Each pair with each seed. ``names``: words of which a pair's name has one; empty: all pairs."""
    chosen = [pair for pair in PAIRS if not names or any(word in pair.name for word in names)]
    return [DifferenceCase(pair, seed, source, {"pair": pair.name}) for seed in seeds for pair in chosen]


def describe_difference(row: Row) -> str:
    """The line that is told of a row."""
    if row["error"]:
        return f"{row['name']}: {row['error']}"
    return f"{row['name']}: {row['true']:.1f} true, {_tell_found(row)}; {row['outcome']}; {row['seconds']:.0f} s"


def make_difference_table(rows: Sequence[Row], command: str) -> str:
    """The table in Markdown: a line for each pair, and the counts."""
    head = [
        "between the scans",
        "part",
        "overlap",
        "lost, mm³",
        "found (95 %)",
        "gained: true, found",
        "outcome",
        "message",
    ]
    body = [
        [row["name"], row["part"], f"{row['overlap']:.0%}", f"{row['true']:.1f}", _tell_found(row),
         f"{row.get('true_gain', 0):.1f}, {row['gain']:.1f}", row["outcome"], row["why"][:160]]
        for row in rows
    ]  # fmt: skip
    counts = {name: sum(row["outcome"] == name for row in rows) for name in ("right", "said", "silent")}
    told = f"{counts['right']} right, {counts['said']} wrong or refused and said, {counts['silent']} wrong and silent."
    seconds = sum(row["seconds"] for row in rows)
    errors = [f"{row['name']}: {row['error']}" for row in rows if row["error"]]
    told = f"{told} Processor time of all: {seconds:.0f} s."
    return "\n\n".join([format_markdown([head, *body]), told, *errors, describe_measurement(f"`{command}`")])


def _tell_found(row: Row) -> str:
    if row["interval"] is None:
        return "refused"
    low, high = row["interval"]
    return f"{row['found']:.1f} ({low:.1f} to {'open' if high is None else f'{high:.1f}'})"
