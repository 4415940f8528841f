"""Makes the files that the example jobs read: `uv run python jobs/make_inputs.py`."""

from __future__ import annotations

from pathlib import Path

import cadquery as cq
import numpy as np
from damageest_benchmarks.differences import BALL, EARLY, LATE, Pair, draw_pair
from damageest_benchmarks.parts import PARTS

from damageest.artefacts import Part, Solid
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.io.meshes import write_points, write_stl
from damageest.stages.scan.simulate import Simulate

HERE = Path(__file__).parent


def gear_step() -> None:
    """A gear of 18 teeth with bore and keyway, 56 mm across."""
    teeth, root, tip, width = 18, 23.0, 28.0, 12.0
    outline = []
    for tooth in range(teeth):
        for share, radius in ((-0.30, root), (-0.13, tip), (0.13, tip), (0.30, root)):
            angle = 2 * np.pi * (tooth + share) / teeth
            outline.append((float(radius * np.cos(angle)), float(radius * np.sin(angle))))
    gear = cq.Workplane("XY").polyline(outline).close().extrude(width)
    gear = gear.cut(cq.Workplane("XY").circle(8).extrude(width))
    gear = gear.cut(cq.Workplane("XY").center(0, 8).rect(4, 5).extrude(width))
    cq.exporters.export(gear, str(HERE / "parts" / "gear.step"))


def half_torus_step() -> None:
    """Half a ring of 76 mm, its section 20 mm across."""
    ring = cq.Workplane("XZ").center(28, 0).circle(10).revolve(180, (-28, 0, 0), (-28, 1, 0))
    cq.exporters.export(ring, str(HERE / "parts" / "half_torus.step"))


def scan_of(part: Part, name: str, damage: list[dict[str, object]], points: int, seed: int) -> None:
    """A simulated scan in unknown pose, as a scanner would write it."""
    scanner = Simulate.model_validate(
        {"damage": damage, "points": points, "density": 0.4, "outliers": 0.002, "pose": "random", "seed": seed}
    )
    x, y, z = scanner.run("mm", part).points.astype(np.float32).T
    write_points(HERE / "scans" / name, {"x": x, "y": y, "z": z})


def worn_shaft() -> None:
    """A keyed shaft, and what its seat in the middle has lost by eccentric wear: 1 mm at the side of positive x, and
    nothing at the opposite side. The mesh is larger than the loss: the shaft bounds it outside."""
    from manifold3d import Manifold

    low, length, radius, depth = -19.0, 28.0, 18.0, 1.0
    seat = Manifold.cylinder(length, radius, radius, 256).translate((-depth, 0, low))
    ring = Manifold.cylinder(length, radius + 1, radius + 1, 256).translate((0, 0, low))
    write_stl(HERE / "parts" / "shaft_loss.stl", Part(*to_arrays(ring - seat)))
    write_stl(HERE / "parts" / "keyed_shaft.stl", PARTS["keyed_shaft"]())


def two_months() -> None:
    """Two scans of some sides of one block, each in a frame of its own: since the first, a corner was chipped off."""
    pair = Pair(
        "", "block", (BALL, 5, (20, 15, 10)), before=EARLY, after=LATE, first=(36_000, 0.03), second=(28_000, 0.04)
    )
    drawn = draw_pair(pair, 3)
    for name, scan in (("block_may", drawn.before), ("block_june", drawn.after)):
        names = ("x", "y", "z", "nx", "ny", "nz")
        write_points(HERE / "scans" / f"{name}.ply", dict(zip(names, scan.astype(np.float32).T, strict=True)))


def main() -> None:
    gear_step()
    half_torus_step()
    worn_shaft()
    two_months()
    for name in ("block", "ribbed_plate", "cylinder"):
        write_stl(HERE / "parts" / f"{name}.stl", PARTS[name]())
    blade = to_manifold(PARTS["blade"]()).simplify(0.02)  # mm, and a quarter of the triangles
    write_stl(HERE / "parts" / "blade.stl", Solid(*to_arrays(blade)))
    wedge = {"tool": "plane", "point": [31.0, 0.0, 9.0], "normal": [0.75, 0.15, 0.65]}
    scan_of(PARTS["block"](), "block_wedge.ply", [wedge], 110_000, 5)


if __name__ == "__main__":
    main()
