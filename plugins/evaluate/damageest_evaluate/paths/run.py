"""Plans each deposit with 3 and with 5 axes, and checks the paths."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from damageest_paths.layers import Layers

from damageest.artefacts import DepositPath, Solid
from damageest_evaluate.paths.beam import count_flips, measure_shaded, measure_sunk
from damageest_evaluate.paths.check import count_crossings, measure_built, measure_nozzle
from damageest_evaluate.paths.scenes import Scene

BEADS = 100.0
"""The volume of a deposit in cubes of the bead's width; it is less wide where the deposit is thin."""
SUFFICES = 0.01
"""Share of a deposit that may be out of reach where a number of axes suffices."""


@dataclass(frozen=True)
class PathRow:
    """One deposit. Lengths in the part's unit; ``gap``: least distance of the nozzle from metal by the independent
    check; ``built``: the same from beads that were laid before; ``claimed``: by the planner. All three in bead widths.
    Shares of the deposit: ``unreached_3``, ``unreached_5``, ``surplus`` (what the beads add beyond it), and ``sunk``
    (what of the beads lies in metal, by the independent check); of the reachable: ``filled``; of the way along passes:
    ``shaded`` (metal in the beam). ``flips``: jumps of the rotary axis. ``seconds_3``, ``seconds_5``: of the
    processor."""

    kind: str
    name: str
    volume: float
    width: float
    height: float
    unreached_3: float
    unreached_5: float
    filled: float
    spill: float
    void: float
    largest_gap: float
    gap: float
    built: float
    claimed: float
    shaded: float
    sunk: float
    surplus: float
    flips: int
    crossings: int
    passes: int
    layers: int
    travel: float
    seconds_3: float
    seconds_5: float


def choose_options(scene: Scene) -> dict[str, object]:
    """Bead and nozzle that fit a deposit: about `BEADS` cubes of the bead's width, not wider than it is thick."""
    thick = 2 * scene.body.volume / scene.body.area
    width = float(f"{min((scene.body.volume / BEADS) ** (1 / 3), 1.5 * thick):.3g}")
    nozzle = {"tip_radius": 0.8 * width, "cone_angle": 20.0, "length": 50 * width, "body_radius": 6 * width}
    return {"width": width, "height": width / 2, "feed": 600.0, "standoff": 3 * width, "nozzle": nozzle}


def evaluate_scene(scene: Scene) -> PathRow:
    """Plans and checks one deposit. The path with 5 axes is simulated and checked."""
    options = choose_options(scene)
    paths, seconds = [], []
    for more in ({"axes": 3, "simulate": False}, {"axes": 5}):
        before = time.process_time()
        stage = Layers.model_validate({**options, **more})
        path = stage.run(body=scene.body, left=scene.left, built=None, tolerance=0.02 * stage.width)
        seconds.append(time.process_time() - before)
        assert path is not None
        paths.append(path)
    plain, path = paths
    gap = _check(path, scene.left)
    fill, width, height = path.fill, path.width, float(path.heights.min())
    return PathRow(
        kind=scene.kind,
        name=scene.name,
        volume=scene.body.volume,
        width=width,
        height=height,
        unreached_3=plain.unreached_volume / scene.body.volume,
        unreached_5=path.unreached_volume / scene.body.volume,
        filled=fill.filled if fill else np.nan,
        spill=fill.spill_distance / width if fill else np.nan,
        void=fill.void / min(width, height) if fill else np.nan,
        largest_gap=fill.largest_gap / (width**2 * height) if fill else np.nan,
        gap=gap / width,
        built=(measure_built(path, path.width / 4 / 2) if path.on.any() else np.inf) / width,
        claimed=min(path.clearance, path.travel_clearance) / width,
        shaded=measure_shaded(path, scene.left, width / 4),
        sunk=measure_sunk(path, scene.left, width / 4) / scene.body.volume,
        surplus=path.surplus_volume / scene.body.volume,
        flips=count_flips(path),
        crossings=count_crossings(path),
        passes=path.passes,
        layers=path.layers,
        travel=path.travel / max(path.length + path.travel, 1e-300),
        seconds_3=seconds[0],
        seconds_5=seconds[1],
    )


def _check(path: DepositPath, left: Solid) -> float:
    """Distance of the nozzle from what is left of the part, ten times finer than the planner looks."""
    return measure_nozzle(path, left, path.width / 4 / 10) if path.on.any() else np.inf


def run_scenes(scenes: Sequence[Scene], tell: Callable[[str], None]) -> list[PathRow]:
    """The rows of all scenes, one after the other."""
    rows = []
    for scene in scenes:
        row = evaluate_scene(scene)
        rows.append(row)
        tell(
            " ".join(
                f"{key}={value:.4g}" if isinstance(value, float) else f"{key}={value}"
                for key, value in asdict(row).items()
            )
        )
    return rows


def make_table(rows: Sequence[PathRow]) -> str:
    """A Markdown table: one line a kind, and all."""
    from damageest_evaluate.readme import format_markdown

    head = [
        "deposits", "number", "out of reach, 3 axes", "5 axes", "5 needed", "filled, least", "spill, largest",
        "void, largest", "nozzle gap, least", "from beads", "in the beam", "sunk, largest", "travel, median",
        "time 3 axes", "5 axes",
    ]  # fmt: skip
    lines = [head]
    for kind in [*dict.fromkeys(row.kind for row in rows), "all"]:
        own = [row for row in rows if kind in (row.kind, "all")]
        needed = sum(row.unreached_3 > SUFFICES >= row.unreached_5 for row in own)
        lines.append(
            [
                kind,
                str(len(own)),
                f"{np.median([row.unreached_3 for row in own]):.1%}",
                f"{np.median([row.unreached_5 for row in own]):.1%}",
                str(needed),
                f"{np.nanmin([row.filled for row in own]):.2%}",
                f"{np.nanmax([row.spill for row in own]):.2f}",
                f"{np.nanmax([row.void for row in own]):.2f}",
                f"{min(row.gap for row in own):.2f}",
                f"{min(row.built for row in own):.2f}",
                f"{max(row.shaded for row in own):.1%}",
                f"{max(row.sunk for row in own):.1%}",
                f"{np.median([row.travel for row in own]):.0%}",
                f"{np.median([row.seconds_3 for row in own]):.1f} s",
                f"{np.median([row.seconds_5 for row in own]):.1f} s",
            ]
        )
    return format_markdown(lines)
