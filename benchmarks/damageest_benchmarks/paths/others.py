"""Deposits on parts that others made: pits in their surface, and edges and corners that are broken off."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from damageest_evaluate.damages import PlacePicker

from damageest.artefacts import Floats, Part
from damageest.geometry.solids import to_manifold
from damageest.geometry.vectors import normalise

WIDTH = 1.2
"""Width of the bead on a part whose diagonal is `DIAGONAL` or more; on smaller parts it is less in proportion."""
DIAGONAL = 60.0
RADII = (3.0, 6.0)
"""Least and largest radius of a loss, in bead widths."""
ROUGH = 0.12
"""Share of its radius by which a loss is rough."""
ATTEMPTS = 20


def make_lump(rng: np.random.Generator, radius: float) -> Any:
    """A rough ball of one piece about 0, a Manifold."""
    from manifold3d import Manifold

    waves = rng.normal(size=(6, 3)) * 3.0
    phase = rng.uniform(0, 2 * np.pi, 6)

    def move(places: Floats) -> Floats:
        out = normalise(places)
        rise = np.sin(out @ waves.T + phase).mean(axis=1, keepdims=True)
        return np.asarray(places * (1 + 2 * ROUGH * rise))

    ball = Manifold.sphere(1.0, 32).warp_batch(move)
    return ball.scale((radius, radius * float(rng.uniform(0.6, 1.0)), radius * float(rng.uniform(0.5, 1.0))))


def read_file(path: Path, registry: Any) -> Part:
    """The part in a file of any format that a plugin reads, in mm. Raises InputError where it is no solid."""
    from damageest import read_part
    from damageest.job import load

    scan = {"use": "simulate"}  # a job has a scan; this one is not made
    return read_part(load({"version": 1, "units": "mm", "part": str(path), "scan": scan}, registry), registry)


def make_on_part(part: Part, name: str, number: int) -> tuple[Any, Any, float]:
    """A part and the tool that takes its loss away, Manifolds about the part's middle, and the width of a bead.

    Odd numbers are at edges. Raises LookupError where no tool leaves one piece of a size that beads can fill.
    """
    rng = np.random.default_rng([4713, number, len(name)])
    picker = PlacePicker(part, rng)
    origin = part.bounds.mean(axis=0)
    body = to_manifold(part, origin)
    width = float(f"{WIDTH * min(1.0, part.diagonal / DIAGONAL):.2g}")
    for _ in range(ATTEMPTS):
        point, normal = picker.pick_edge_point() if number % 2 else picker.pick_point()
        radius = width * float(rng.uniform(*RADII))
        tool = make_lump(rng, radius).rotate(picker.draw_rotation())
        tool = tool.translate(tuple(point - origin + float(rng.uniform(-0.3, 0.3)) * radius * normal))
        lost = body ^ tool
        if lost.volume() > 20 * width**3:
            return body, tool, width
    raise LookupError(f"{name}: no loss {number + 1} fits")
