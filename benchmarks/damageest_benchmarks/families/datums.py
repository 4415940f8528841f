"""Parts held by datums, sound or worn, whose other faces are sound or worn."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Mesh, Scan
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.solids import to_arrays, to_solid
from damageest_benchmarks.families.scene import Draw, draw_motion, move_out, to_part

POINTS = 40_000
NOISE = 0.0003
"""As a share of the diagonal; the tolerance is four of them."""
STATES = ("others worn", "others sound", "datum worn", "datum partly worn")
FORMS = ("system", "list")
"""How the job names the datums: A, B, C with precedence, or as a list of trusted faces."""
DIRECTIONS = {"A": (0, 0, -1), "B": (0, -1, 0), "C": (-1, 0, 0)}
DEEP = (2.0, 6.0)
"""Depth of wear, in tolerances."""


def _make_body(rng: np.random.Generator) -> tuple[Any, np.ndarray]:
    """A bracket with a boss and a bore, and the extent (3,) of its base, which begins at the origin."""
    from manifold3d import Manifold

    length, width, height = rng.uniform((50, 30, 12), (80, 50, 20))
    boss = rng.uniform(0.4, 0.6) * width
    place = np.array([rng.uniform(0.1, 0.4) * length, rng.uniform(0.1, 0.3) * width])
    body = Manifold.cube((length, width, height)) + Manifold.cube((boss, boss, height + 15)).translate((*place, 0))
    bore = Manifold.cylinder(height + 20, 0.25 * boss, 0.25 * boss, 64).translate((*(place + boss / 2), -2))
    return body - bore, np.array([length, width, height])


def _wear_datum(body: Any, size: np.ndarray, wear: float, share: float) -> Any:
    """What is left where a ``share`` of datum A is worn off. Worn all over, it is where A lies all the same: what is
    then lost in the frame of the datums is lost elsewhere."""
    from manifold3d import Manifold

    left = body - Manifold.cube((share * size[0] + 1, size[1] + 2, wear + 1)).translate((-1, -1, -1))
    return left.translate((0, 0, -wear)) if share == 1 else left


def _wear_others(body: Any, size: np.ndarray, wear: float) -> Any:
    """What is left where the faces against A, B and C are worn off evenly."""
    from manifold3d import Manifold

    top = Manifold.cube((300, 300, 300)).translate((-150, -150, size[2] + 15 - wear))
    long = Manifold.cube((300, 300, 300)).translate((-150, size[1] - wear, -150))
    end = Manifold.cube((300, 300, 300)).translate((size[0] - wear, -150, -150))
    return body - top - long - end


def draw_datums(seed: int) -> Draw:
    """A draw of the family, its truth in the frame of the datums as they are."""
    rng = np.random.default_rng([8104, seed])
    state, form = STATES[seed % 4], FORMS[seed // 4 % 2]
    body, size = _make_body(rng)
    part = to_part(Mesh(*to_arrays(body)), "bracket")
    noise = NOISE * part.diagonal
    wear = 4 * noise * rng.uniform(*DEEP)
    left = body
    if state.startswith("datum"):
        left = _wear_datum(body, size, wear, rng.uniform(0.15, 0.35) if state == "datum partly worn" else 1.0)
    elif state == "others worn":
        left = _wear_others(body, size, wear)
    if state != "others worn":  # a chip, so that there is something to find
        from manifold3d import Manifold

        left -= Manifold.sphere(0.1 * part.diagonal, 64).translate((size[0], size[1], size[2]))
    points = sample_by_area(Mesh(*to_arrays(left)), POINTS, rng)[0]
    scan = Scan(points + rng.normal(scale=noise, size=points.shape), unit="mm")
    scan, pose = move_out(scan, draw_motion(rng, part.diagonal))
    facing = {name: f"{{facing: {{direction: {list(way)}, angle: 5}}}}" for name, way in DIRECTIONS.items()}
    named = ", ".join(facing.values())
    ordered = ", ".join(f"{name}: [{text}]" for name, text in facing.items())
    datum = f"[{named}]" if form == "list" else f"{{{ordered}}}"
    said: dict[str, str | float] = {"state": state, "form": form, "wear": wear, "tolerance": 4 * noise}
    return Draw(
        part, scan, to_solid(body - left, np.zeros(3)), pose, 4 * noise, said=said,
        settings=("adapt=none", f"align={{use: register, datum: {datum}}}"),
    )  # fmt: skip
