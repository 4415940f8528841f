"""Deposits to plan paths for: those of job files, random ones, pockets, worn bores, blade tips and broken teeth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from damageest_evaluate.damages import KINDS, make_random_damage

from damageest.artefacts import Part, Solid
from damageest.geometry.solids import to_manifold, to_solid
from damageest.stages.scan.scanner import apply_tools
from damageest_benchmarks.parts import PARTS
from damageest_benchmarks.paths.others import make_on_part, read_file
from damageest_benchmarks.paths.tight import TIGHT

LARGE = 30_000
"""Triangles of a part from which a deposit on it comes late."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A deposit: ``kind`` and ``name``; the solid to build up, and what is left of the part. ``width``: of the bead;
    None: one that fits the deposit."""

    kind: str
    name: str
    body: Solid
    left: Solid
    width: float | None = None


def _cut(kind: str, name: str, part: Any, tool: Any) -> list[Scene]:
    """One deposit for each piece of the part within the tool, a Manifold, but for crumbs."""
    lost = part ^ tool
    left = to_solid(part - tool)
    pieces = sorted(lost.decompose(), key=lambda piece: -piece.volume())
    found = [to_solid(piece) for piece in pieces if piece.volume() > 0.05 * lost.volume()]
    many = len(found) > 1
    return [
        Scene(kind, f"{name}.{number}" if many else name, body, left)
        for number, body in enumerate(found, 1)
        if body is not None and left is not None
    ]


def make_pocket(rng: np.random.Generator, name: str) -> list[Scene]:
    """A box or a round pocket in a block, from shallow to deeper than wide, its walls leaning or upright."""
    from manifold3d import Manifold

    block = Manifold.cube((80, 60, 40)).translate((-40, -30, -40))
    wide, depth = rng.uniform(12, 26), rng.uniform(4, 18)
    tool = Manifold.cylinder(2 * depth, wide / 2, wide / 2 * rng.uniform(1.0, 1.7), 64).translate((0, 0, -depth))
    if rng.random() < 0.5:
        tool = Manifold.cube((wide, wide * rng.uniform(0.5, 1), 2 * depth), True)
    return _cut("pocket", name, block, tool.rotate((0, 0, float(rng.uniform(0, 90)))))


def make_bore(rng: np.random.Generator, name: str) -> list[Scene]:
    """A bore worn to one side."""
    from manifold3d import Manifold

    radius, length = rng.uniform(14, 24), rng.uniform(12, 30)
    part = Manifold.cylinder(length, 2 * radius, 2 * radius, 128) - Manifold.cylinder(
        3 * length, radius, radius, 128, True
    )
    worn = float(rng.uniform(0.8, 3.0))
    tool = Manifold.cylinder(3 * length, radius, radius, 128, True).translate((worn, 0, 0))
    return _cut("bore", name, part, tool)


def make_tip(rng: np.random.Generator, name: str) -> list[Scene]:
    """The tip of a blade, broken off along a slanting plane."""
    from manifold3d import Manifold

    x = np.linspace(-1, 1, 25)
    thick, wide = rng.uniform(1.5, 3.0), rng.uniform(12, 20)
    outline = np.concatenate(
        [
            np.column_stack([wide * x, thick * (1 - x**2) + 0.3]),
            np.column_stack([wide * x, -thick * (1 - x**2) - 0.3])[::-1],
        ]
    )
    from manifold3d import CrossSection

    blade = Manifold.extrude(CrossSection([outline[::-1]]), 50, 30, float(rng.uniform(0, 30)))
    tool = (
        Manifold.cube((200, 200, 60), True)
        .translate((0, 0, 30))
        .rotate((float(rng.uniform(-10, 10)), float(rng.uniform(-20, 20)), 0))
    )
    return _cut("tip", name, blade, tool.translate((0, 0, float(rng.uniform(38, 44)))))


def make_tooth(rng: np.random.Generator, name: str) -> list[Scene]:
    """A broken tooth of a gear, or two."""
    from manifold3d import Manifold

    gear = PARTS["gear"]()
    origin = gear.bounds.mean(axis=0)
    angle, out = rng.uniform(0, 2 * np.pi), float(np.ptp(gear.bounds[:, 0])) / 2
    size = out * rng.uniform(0.25, 0.45)
    tool = Manifold.cube((size, size, out), True).rotate((float(rng.uniform(-25, 25)), 0, float(np.degrees(angle))))
    return _cut(
        "tooth",
        name,
        to_manifold(gear, origin),
        tool.translate((out * np.cos(angle), out * np.sin(angle), float(rng.uniform(-4, 4)))),
    )


MAKERS: dict[str, Callable[[np.random.Generator, str], list[Scene]]] = {
    "pocket": make_pocket,
    "bore": make_bore,
    "tip": make_tip,
    "tooth": make_tooth,
}


def make_random(seed: int) -> list[Scene]:
    """A random damage of the suite, of each kind in turn on each part in turn."""
    name, kind = list(PARTS)[seed % len(PARTS)], list(KINDS)[(seed + seed // len(PARTS)) % len(KINDS)]
    part = PARTS[name]()
    found = make_random_damage(part, 900 + seed, (kind,), 1)
    return _split("random", f"{seed + 1} {name} {found.kinds[0]}", part, found.damage)


def _split(kind: str, name: str, part: Part, damage: Solid) -> list[Scene]:
    origin = part.bounds.mean(axis=0)
    return _cut(kind, name, to_manifold(part, origin), to_manifold(damage, origin))


def read_job(path: Path, registry: Any) -> list[Scene]:
    """The true losses of a job with a virtual scan; none for a job with a real one."""
    from damageest import read_part
    from damageest.job import load
    from damageest.stages.scan import ReadScan

    job = load(path, registry)
    tools = getattr(job.stages[ReadScan], "damage", ())
    if not tools:
        return []
    part = read_part(job, registry)
    damage = apply_tools(part, tools)[1]
    return _split("job", path.stem, part, damage) if damage is not None else []


def make_on_others(path: Path, each: int, registry: Any) -> list[Scene]:
    """Losses of a part that others made; those that fit."""
    read = read_file(path, registry)
    found = []
    for number in range(each):
        try:
            part, tool, width = make_on_part(read, path.stem, number)
        except LookupError:
            continue
        for scene in _cut("others", f"{path.name} {number + 1}", part, tool)[:1]:
            found.append(replace(scene, width=width))
    return found


def make_scenes(jobs: Sequence[Path], each: int, random: int, parts: Sequence[Path], registry: Any) -> list[Scene]:
    """Deposits of the jobs, ``each`` of the kinds that are made to measure and on each of the ``parts``, and ``random``
    of the suite. They come in turn, one of each kind, part and job, those that take a minute each at the end: so what a
    run has done when it is stopped is of all the others."""
    groups = [make_on_others(path, each, registry) for path in parts]
    numbers = range(each)
    for kind, make in MAKERS.items():
        seeds = [np.random.default_rng([4711, number, len(kind)]) for number in numbers]
        groups.append([make(seed, f"{kind} {number + 1}")[0] for number, seed in zip(numbers, seeds, strict=True)])
    for kind, lose in TIGHT.items():
        losses = [lose(np.random.default_rng([4712, number, len(kind)])) for number in numbers]
        names = [f"{kind} {number + 1}" for number in numbers]
        groups.append([_cut(kind, name, *loss)[0] for name, loss in zip(names, losses, strict=True)])
    groups.append([scene for seed in range(random) for scene in make_random(seed)[:1]])
    groups += [read_job(path, registry) for path in jobs]
    scenes = [scene for turn in zip_longest(*groups) for scene in turn if scene is not None]
    return sorted(scenes, key=lambda scene: scene.kind == "bore" or len(scene.left.faces) > LARGE)
