"""Plans each deposit with 3 and with 5 axes, and checks the paths."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from damageest_evaluate.rows import read_rows
from damageest_paths.layers import Layers

from damageest.artefacts import DepositPath
from damageest_benchmarks.paths.beam import count_flips, measure_shaded, measure_sunk
from damageest_benchmarks.paths.check import count_crossings, measure_built, measure_nozzle
from damageest_benchmarks.paths.practice import measure_practice
from damageest_benchmarks.paths.scenes import Scene
from damageest_benchmarks.paths.tilt import measure_beyond_need

BEADS = 100.0
"""The volume of a deposit in cubes of the bead's width; it is less wide where the deposit is thin."""
MUCH = 0.5
"""Share of a deposit that is out of reach from which a path counts only for that."""


@dataclass(frozen=True)
class PathRow:
    """One path. Lengths in the part's unit; ``gap``: least distance of the nozzle from metal by the independent check;
    ``built``: the same from beads that were laid before; ``claimed``: by the planner. All three in bead widths, as
    ``spill``; ``void`` in heights. Shares of the deposit: ``unreached``, ``surplus`` (what the beads add beyond it),
    and ``sunk`` (what of the beads lies in metal, by the independent check); of the reachable: ``filled``; of the way
    along passes: ``shaded`` (metal in the beam), ``travel``, and ``between`` (travel without the first way in and the
    last way out). ``why``: what of the deposit is out of reach, by reason. ``flips``: jumps of the rotary axis.
    ``seconds``: of the processor, to plan; ``checked``: to check. ``beyond``, ``beyond_95``, ``beyond_mean``: as in
    `Beyond`. The rest as in `Practice`."""

    kind: str
    name: str
    axes: int
    volume: float
    width: float
    height: float
    unreached: float
    filled: float
    spill: float
    void: float
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
    between: float
    seconds: float
    checked: float
    why: dict[str, float]
    starts_a_layer: float
    starts_a_region: float
    joinable: int
    reversals: int
    corners: int
    tilted: float
    jumps: int
    air: float
    air_95: float
    floating: float
    beyond: float
    beyond_95: float
    beyond_mean: float


def choose_options(scene: Scene) -> dict[str, object]:
    """Bead and nozzle that fit a deposit: about `BEADS` cubes of the bead's width, not wider than it is thick. Where
    the scene says the width, the standoff is five of it."""
    if scene.width is not None:
        width, standoff = scene.width, 5 * scene.width
    else:
        thick = 2 * scene.body.volume / scene.body.area
        width = float(f"{min((scene.body.volume / BEADS) ** (1 / 3), 1.5 * thick):.3g}")
        standoff = 3 * width
    nozzle = {"tip_radius": 0.8 * width, "cone_angle": 20.0, "length": 50 * width, "body_radius": 6 * width}
    return {"width": width, "height": width / 2, "feed": 600.0, "standoff": standoff, "nozzle": nozzle}


def evaluate_scene(scene: Scene, axes: int) -> PathRow:
    """Plans, simulates and checks one path."""
    before = time.process_time()
    stage = Layers.model_validate({**choose_options(scene), "axes": axes})
    path = stage.run(body=scene.body, left=scene.left, built=None, tolerance=0.02 * stage.width)
    planned = time.process_time()
    assert path is not None
    return check_path(scene, stage, path, planned - before)


def check_path(scene: Scene, stage: Layers, path: DepositPath, seconds: float) -> PathRow:
    """Checks a path of a scene that a ``stage`` took ``seconds`` of the processor to plan."""
    before = time.process_time()
    fill, width, height = path.fill, path.width, float(path.heights.min())
    is_some = bool(path.on.any())
    beyond = measure_beyond_need(path, scene.left, stage)
    row = PathRow(
        kind=scene.kind,
        name=scene.name,
        axes=5 if stage.axes == 5 else 3,
        volume=scene.body.volume,
        width=width,
        height=height,
        unreached=path.unreached_volume / scene.body.volume,
        filled=fill.filled if fill else np.nan,
        spill=fill.spill_distance / width if fill else np.nan,
        void=fill.void / min(width, height) if fill else np.nan,
        gap=(measure_nozzle(path, scene.left, width / 4 / 10) if is_some else np.inf) / width,
        built=(measure_built(path, width / 4) if is_some else np.inf) / width,
        claimed=min(path.clearance, path.travel_clearance) / width,
        shaded=measure_shaded(path, scene.left, width / 4),
        sunk=measure_sunk(path, scene.left, width / 4) / scene.body.volume,
        surplus=path.surplus_volume / scene.body.volume,
        flips=count_flips(path),
        crossings=count_crossings(path),
        passes=path.passes,
        layers=path.layers,
        travel=path.travel / path.length if is_some else np.nan,
        between=_measure_between(path) / path.length if is_some else np.nan,
        seconds=seconds,
        checked=0.0,
        why={item.why: item.volume / scene.body.volume for item in path.unreached},
        **asdict(measure_practice(path, scene.left)),
        beyond=beyond.median,
        beyond_95=beyond.most,
        beyond_mean=beyond.mean,
    )
    return replace(row, checked=time.process_time() - before)


def _measure_between(path: DepositPath) -> float:
    """The length of the moves between passes, from the start of the first to the end of the last."""
    on = np.flatnonzero(path.on)
    inside = np.arange(on[0], on[-1] + 1)
    return float(path.moves[inside[~path.on[inside]]].sum())


def run_scenes(scenes: Sequence[Scene], out: Path | None = None) -> Iterator[PathRow]:
    """The rows of all scenes, first with 5 axes, then with 3. Those that the file ``out`` has are taken from it, others
    are appended to it."""
    known = {(row["kind"], row["name"], row["axes"]): PathRow(**row) for row in read_rows(out)}
    for axes in (5, 3):
        for scene in scenes:
            row = known.get((scene.kind, scene.name, axes))
            if row is None:
                row = evaluate_scene(scene, axes)
                if out:
                    with out.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(asdict(row)) + "\n")
            yield row


def describe_row(row: PathRow) -> str:
    """A row on one line."""
    return " ".join(
        f"{key}={value:.4g}" if isinstance(value, float) else f"{key}={value}" for key, value in asdict(row).items()
    )


@dataclass(frozen=True)
class Demand:
    """What is asked of each path that is not mostly out of reach: ``least`` or ``most`` of a value of its row."""

    words: str
    name: str
    form: str
    least: float = -np.inf
    most: float = np.inf

    def find_worst(self, rows: Sequence[PathRow]) -> PathRow:
        sign = 1 if np.isfinite(self.most) else -1
        return max(rows, key=lambda row: sign * float(getattr(row, self.name)))

    def holds(self, row: PathRow) -> bool:
        return self.least <= float(getattr(row, self.name)) <= self.most


DEMANDS = (
    Demand("no point of the beam in metal", "shaded", ".1%", most=0.0),
    Demand("sunk at most 5 % of the deposit", "sunk", ".1%", most=0.05),
    Demand("spill at most 1.1 bead widths", "spill", ".2f", most=1.1),
    Demand("filled at least 99.5 % of what is reachable", "filled", ".2%", least=0.995),
    Demand("travel at most twice the deposition", "travel", ".2f", most=2.0),
    Demand("nozzle clear of metal, bead widths", "gap", ".2f", least=1e-9),
    Demand("nozzle clear of earlier beads, bead widths", "built", ".2f", least=1e-9),
    Demand("no jump of the rotary axis", "flips", "d", most=0),
    Demand("no reversal with the process on", "reversals", "d", most=0),
    Demand("starts a layer and region at most 3", "starts_a_region", ".1f", most=3.0),
    Demand("floating at most 2 %", "floating", ".1%", most=0.02),
    Demand("tilted no more than needed, in the median", "beyond", ".0f", most=0.0),
)
TRAVEL = 0.2
"""Median of travel over deposition that is asked for."""


def make_demands(rows: Sequence[PathRow], axes: int = 5) -> str:
    """A Markdown table: a line for each demand, on how many paths it holds, and the worst of them."""
    from damageest_evaluate.tables import format_markdown

    own = [row for row in rows if row.axes == axes and row.unreached < MUCH and row.passes]
    lines = [["demand", "holds on", "worst", "there"]]
    for demand in DEMANDS if own else ():
        worst = demand.find_worst(own)
        value = format(getattr(worst, demand.name), demand.form)
        lines.append([demand.words, f"{sum(map(demand.holds, own))} of {len(own)}", value, worst.name])
    if own:
        middle = float(np.median([row.travel for row in own]))
        between = float(np.median([row.between for row in own]))
        words = f"{between:.0%} without the way in and out"
        lines.append(
            [f"median travel at most {TRAVEL:.0%}", "yes" if middle <= TRAVEL else "no", f"{middle:.0%}", words]
        )
    return format_markdown(lines)


def make_table(rows: Sequence[PathRow]) -> str:
    """A Markdown table: a line for each kind and number of axes, and for all."""
    from damageest_evaluate.tables import format_markdown

    head = [
        "deposits", "axes", "number", "out of reach", "filled, least", "spill", "void", "gap", "from beads",
        "in the beam", "sunk", "flips", "travel, median", "largest", "starts a layer", "and region", "reversals",
        "corners", "tilted", "beyond need, 95 %", "axis jumps", "air, median", "air, 95 %", "floating",
        "time, median", "largest",
    ]  # fmt: skip
    lines = [head]
    for kind in [*dict.fromkeys(row.kind for row in rows), "all"]:
        for axes in (3, 5):
            own = [row for row in rows if kind in (row.kind, "all") and row.axes == axes]
            if own:
                lines.append(_make_line(kind, axes, own))
    return format_markdown(lines)


def _make_line(kind: str, axes: int, own: Sequence[PathRow]) -> list[str]:
    """What a path has that reaches less than `MUCH` counts for what is out of reach, not for the rest."""
    some = [row for row in own if row.unreached < MUCH] or list(own)
    return [
        kind,
        str(axes),
        str(len(own)),
        f"{np.median([row.unreached for row in own]):.1%}",
        f"{np.nanmin([row.filled for row in some]):.1%}",
        f"{np.nanmax([row.spill for row in some]):.2f}",
        f"{np.nanmax([row.void for row in some]):.2f}",
        f"{min(row.gap for row in own):.2f}",
        f"{min(row.built for row in own):.2f}",
        f"{max(row.shaded for row in own):.1%}",
        f"{max(row.sunk for row in own):.1%}",
        str(sum(row.flips for row in own)),
        f"{np.nanmedian([row.travel for row in some]):.0%}",
        f"{np.nanmax([row.travel for row in some]):.0%}",
        f"{np.median([row.starts_a_layer for row in some]):.1f}, most {max(row.starts_a_layer for row in some):.1f}",
        f"{np.median([row.starts_a_region for row in some]):.1f}, most {max(row.starts_a_region for row in some):.1f}",
        str(sum(row.reversals for row in some)),
        str(sum(row.corners for row in some)),
        f"{np.median([row.tilted for row in some]):.0%}",
        f"{max(row.beyond_95 for row in some):.0f}",
        str(sum(row.jumps for row in some)),
        f"{np.nanmedian([row.air for row in some]):.2f}",
        f"{np.nanmedian([row.air_95 for row in some]):.2f}",
        f"{np.median([row.floating for row in some]):.0%}",
        f"{np.median([row.seconds for row in own]):.1f} s",
        f"{max(row.seconds for row in own):.1f} s",
    ]
