"""Whether a scan that is drawn again gives the same verdicts, and volumes inside the intervals."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from damageest_evaluate.processes import Row

from damageest.artefacts import Floats, Scan, Solid
from damageest.errors import DamageestError, StageError, describe_error
from damageest.geometry.solids import to_manifold
from damageest.geometry.transforms import move_mesh
from damageest.result import Result, Site
from damageest_benchmarks.troubles.case import TroubleCase, make_scan, make_scene
from damageest_benchmarks.troubles.scene import Scanning

SAME = 0.5
"""Share of the smaller of two sites inside the other from which they are the same one."""
NUMBERS = (
    1,
    2,
    3,
    4,
    5,
    6,
    7,
    10,
    70,
    73,
    99,
    112,
    119,
    121,
    122,
    200,
    205,
    206,
    214,
    216,
    219,
    221,
    232,
    235,
    240,
    243,
)
"""Cases of the suite that are drawn again: ordinary damage, wear, waves, bent parts, in known and unknown pose."""


class Draw(NamedTuple):
    """Another draw: the points from ``start`` on, ``share`` of the usual number; ``turn``: whether the scan stands in
    another frame; ``tolerance``: times the usual one."""

    start: int = 0
    share: float = 1.0
    turn: bool = False
    tolerance: float = 1.0


DRAWS: Mapping[str, Draw] = {
    "other points": Draw(start=1),
    "half the points": Draw(share=0.5),
    "another frame": Draw(turn=True),
    "a tolerance 10 % larger": Draw(tolerance=1.1),
}


@dataclass(frozen=True)
class SteadyCase(TroubleCase):
    """A case of the honesty suite whose scan is drawn again."""

    def make_blank_row(self) -> Row:
        row = {name: getattr(self, name) for name in ("kind", "part", "pose", "number", "seed", "points")}
        return row | {"key": self.compute_key(), "sites": [], "error": "", "seconds": 0.0}

    def run(self) -> Row:
        return run_steady(self)


def run_steady(case: SteadyCase) -> Row:
    """The row of a case: for each draw and each site of the first run, what became of it."""
    row, start = case.make_blank_row(), time.perf_counter()
    try:
        scene = make_scene(replace(case, points=2 * case.points))
    except (LookupError, StageError) as error:
        return row | {"error": describe_error(error)}
    scan, _ = make_scan(case, scene)
    settings = [*(["align=none"] if case.pose == "known" else []), *scene.settings]
    tolerance = Scanning(case.part, case.seed, amount=case.amount).tolerance

    def run(draw: Draw) -> tuple[Result, Floats]:
        first = draw.start * case.points
        taken, turn = scan.take(np.arange(first, first + round(draw.share * case.points))), _make_turn(scan, draw.turn)
        words = ["allowance=none", f"tolerance={draw.tolerance * tolerance:.6g}", *settings]
        if case.pose == "known":  # the frame is given, and stays
            turn = np.eye(4)
        return _run(scene.part, taken.move(turn), words), turn

    try:
        base, _ = run(Draw())
        for name, draw in DRAWS.items():
            if draw.turn and case.pose == "known":
                continue
            row["sites"] += compare_sites(name, base, run(draw)[0])
    except DamageestError as error:
        row["error"] = describe_error(error)
    return row | {"seconds": time.perf_counter() - start}


def compare_sites(name: str, base: Result, again: Result) -> list[dict[str, Any]]:
    """What became of each site of ``base`` in a result ``again`` of the same part, scanned anew."""
    back = _find_motion(base, again)
    others = [replace(site, damage=move_mesh(site.damage, back)) for site in again.sites]
    return [_compare(name, site, others) for site in base.sites]


def _compare(name: str, site: Site, others: Sequence[Site]) -> dict[str, Any]:
    shares = [_share(site.damage, one.damage) for one in others]
    found = others[int(np.argmax(shares))] if shares and max(shares) > SAME else None
    low, high = site.volume_95 or (0.0, np.inf)
    return {
        "draw": name,
        "before": site.verdict.level,
        "after": found.verdict.level if found else "none",
        "accepted": [site.accepted, bool(found and found.accepted)],
        "volumes": [site.damage.volume, found.damage.volume if found else None],
        "inside": found is None or bool(low <= found.damage.volume <= high),
    }


def _share(one: Solid, other: Solid) -> float:
    """Volume that two solids share, of the smaller one's."""
    origin = one.bounds.mean(axis=0)
    both = (to_manifold(one, origin) ^ to_manifold(other, origin)).volume()
    return float(both / max(min(one.volume, other.volume), 1e-300))


def _find_motion(base: Result, again: Result) -> Floats:
    """The motion (4,4) of a symmetric part onto itself that brings the sites of ``again`` nearest to those of
    ``base``."""
    poses = again.pose.alternatives
    motions = [np.eye(4)]
    if poses is not None:
        motions += [one @ np.linalg.inv(again.pose.T_part_scan) for one in poses]
    if not base.sites or not again.sites:
        return motions[0]
    largest = max(base.sites, key=lambda site: site.damage.volume).damage
    fits = [max(_share(largest, move_mesh(site.damage, one)) for site in again.sites) for one in motions]
    return np.asarray(motions[int(np.argmax(fits))])


def _make_turn(scan: Scan, is_turned: bool) -> Floats:
    from scipy.spatial.transform import Rotation

    turn = np.eye(4)
    if is_turned:
        turn[:3, :3] = Rotation.from_rotvec([1.0, 2.0, -0.7]).as_matrix()
        turn[:3, 3] = scan.points.mean(axis=0)
    return turn


def _run(part: Any, scan: Scan, settings: Sequence[str]) -> Result:
    import damageest

    return damageest.run({"version": 1}, part=part, scan=scan, settings=settings)


def make_steady_table(rows: Sequence[Row]) -> list[list[str]]:
    """Head and body of a table: a line for each draw, and one for all."""
    sites = [site for row in rows for site in row["sites"]]
    groups = {name: [site for site in sites if site["draw"] == name] for name in DRAWS} | {"all": sites}
    head = ["drawn again", "sites", "same verdict", "accepted alike", "found again", "volume inside the interval"]
    return [head, *([name, *_count(group)] for name, group in groups.items() if group)]


def _count(sites: Sequence[Mapping[str, Any]]) -> list[str]:
    again = [site for site in sites if site["after"] != "none"]
    counts = [
        sum(site["before"] == site["after"] for site in sites),
        sum(site["accepted"][0] == site["accepted"][1] for site in sites),
        len(again),
    ]
    inside = sum(site["inside"] for site in again)
    return [str(len(sites)), *(f"{one / len(sites):.0%}" for one in counts), f"{inside / max(len(again), 1):.0%}"]
