"""The table that `damageest run` prints at the end: sites, coverage, what the scan can show, surplus, notes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from damageest.errors import clean_message

if TYPE_CHECKING:
    from damageest.findings import Sensor, Surplus
    from damageest.result import Result


Show = Callable[[str], None]
"""Prints one line."""
MOST_UNSEEN = 5
"""Unseen regions that are printed; result.json has all."""
STRAYS = 0.005
"""Share of the scan's points at either end that its size does without."""
MOST_SURPLUS = 3
"""Surpluses of a kind that are printed each by itself, largest first; result.json has all."""
UNSEEN_WHY = {
    "hidden": "hidden by the part from every scanner position",
    "outside": "outside every view",
    "no points": "in view, but without points",
    "earlier scan": "not in the earlier scan either",
}


def print_table(result: Result, target: Path) -> None:
    """Prints the sites with the result of the check against the scan, notes, and the path of the output folder."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from damageest.findings import describe_interval, describe_volume, write_digits
    from damageest.geometry.units import describe_size
    from damageest.rules.advice import list_topics
    from damageest.rules.notes import cap_notes, list_notes, qualify_nothing

    console = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 160)

    def show(text: str, label: str = "", style: str = "") -> None:
        console.print(Text(label, style) + Text(clean_message(text)))  # no text is markup

    unit = result.units
    for text in result.scan.columns if result.scan else ():
        show(text)
    if result.sites:
        table = Table(title=None, box=None, pad_edge=False, header_style="bold")
        heads = ["site", f"volume {unit}³", f"area {unit}²", f"depth {unit}"]
        if any(site.deposit for site in result.sites):
            heads += [f"deposit {unit}³", f"stock {unit}³"]
        for name in (*heads, "95 %", "method", "verdict"):
            table.add_column(name, justify="left" if name in ("method", "verdict") else "right")
        for site in result.sites:
            verdict = site.verdict.level + ("" if site.accepted == (site.verdict.level != "doubtful") else ", accepted")
            volume = describe_volume(site.damage.volume, site.volume_95)
            numbers = [volume, write_digits(site.surface.area, 3), write_digits(site.max_depth, 3)]
            if len(heads) > 4:
                stock = getattr(site.deposit, "stock_volume", None)
                numbers += [write_digits(site.deposit.volume, 4) if site.deposit else "–"]
                numbers += ["–" if stock is None else write_digits(stock, 4)]
            table.add_row(str(site.id), *numbers, describe_interval(site.volume_95), site.method, verdict)
        console.print(table)
        known = "" if result.volume_95 is None else f" (95 %: {describe_interval(result.volume_95)})"
        # what an earlier scan shows bounds no volume of its own
        whole = (
            "" if result.part.unseen is not None else f"; part volume: {write_digits(result.part.volume, 6)} {unit}³"
        )
        show(f"damage volume: {describe_volume(result.damage_volume, result.volume_95)} {unit}³{known}{whole}")
        if volumes := result.describe_volumes():
            show(f"components: {volumes}")
    elif not result.failures:
        where = f"{_on_seen(result)}{qualify_nothing(result.warnings)}"
        show(f"no damage deeper than the tolerance of {result.tolerance:.4g} {unit} was found{where}")
        if result.pose.free and result.volume_95 and result.volume_95[1] > 0:
            most = f"{result.volume_95[1]:.4g} {unit}³"
            show(
                f"the pose is free: wear of up to {most} over a whole face stays hidden. Name unworn faces in "
                "align.datum"
            )
    scan = describe_size(result.aligned.points, unit, STRAYS)
    show(f"part {describe_size(result.part.vertices, unit)}, scan {scan} along the part's axes")
    _print_coverage(result, show)
    if result.sensor is not None:
        show(_describe_sensor(result.sensor, unit))
    if result.fit is not None and result.fit.model == "ok":  # otherwise it is among the notes
        show(f"fit: {result.fit.words}")
    for text in list_surplus(result.surplus, unit):
        show(text)
    for text in result.failures:
        show(f" {text}", "failed:", "red")
    told = [str(note) for note in result.warnings if note.code == "report"]  # a file that is looked for: always said
    for text in [*cap_notes([text for text in list_notes(result) if text not in told]), *told]:
        show(f" {text}", "note:", "yellow")
    if topics := list_topics(result):
        show(f"help: damageest explain {' '.join(topics)}")
    show(f"written to {target}")


def _on_seen(result: Result) -> str:
    """Where the scan shows a part of the skin only, the share that a statement about all of it is limited to."""
    coverage = result.coverage
    return f" on the {coverage.seen:.0%} of the skin that the scan shows" if coverage and coverage.seen < 0.995 else ""


def _print_coverage(result: Result, show: Show) -> None:
    """Prints how much of the skin the scan shows, and the largest of the rest."""
    coverage = result.coverage
    if coverage is None:
        return
    unit = result.units
    show(f"tolerance: {result.tolerance:.4g} {unit}; the scan shows {coverage.seen:.0%} of the skin")
    regions = [region for region in coverage.unseen if region.why != "earlier scan"]  # a note tells of those
    for region in regions[:MOST_UNSEEN]:
        x, y, z = region.centre
        why = "" if region.why == "unknown" else f" ({UNSEEN_WHY[region.why]})"
        show(
            f"unseen: {region.area:.3g} {unit}² near ({x:.3g}, {y:.3g}, {z:.3g}){why}; it may hide a loss of up to "
            f"{region.volume:.3g} {unit}³"
        )
    if more := regions[MOST_UNSEEN:]:
        show(f"unseen: {len(more)} smaller regions, {sum(one.area for one in more):.3g} {unit}²")


def _describe_sensor(sensor: Sensor, unit: str) -> str:
    """The smallest loss that the scan can show, and why."""
    why = [f"noise {sensor.noise:.2g}"]
    if sensor.correlated > sensor.noise / 4:
        why.append(f"errors of {sensor.correlated:.2g} common to regions of {sensor.alike:.2g}")
    if sensor.depth_step:
        why.append(f"depth steps {sensor.depth_step:.2g}")
    least = f"{sensor.least_depth:.3g} {unit} deep, {sensor.least_width:.2g} {unit} wide"
    return f"smallest visible loss: {least} ({', '.join(why)})"


def list_surplus(items: Sequence[Surplus], unit: str) -> list[str]:
    """A line for each of the largest of a kind, and one for the rest of them."""
    kinds = {kind: [item for item in items if item.kind == kind] for kind in ("surplus", "displaced piece")}
    small = {kind: some[MOST_SURPLUS:] for kind, some in kinds.items() if len(some) > MOST_SURPLUS}
    folded = {item.id for some in small.values() for item in some}
    lines = [_describe_surplus(item, unit) for item in items if item.id not in folded]
    return [*lines, *(_merge_surplus(kind, some, unit) for kind, some in small.items())]


def _merge_surplus(kind: str, items: Sequence[Surplus], unit: str) -> str:
    """One line for many surpluses of a kind, with the volume of those that are closed, and an estimate for others."""
    closed = [item.volume for item in items if item.volume is not None]
    guessed = sum(item.estimate for item in items if item.volume is None)
    volumes = [f"{sum(closed):.4g} {unit}³ together"] if closed else []
    if left := len(items) - len(closed):
        which = f"{left} of them open" if closed else "open"
        volumes.append(f"{which}, about {guessed:.2g} {unit}³ (estimate)")
    height, area = max(item.height for item in items), sum(item.area for item in items)
    named = "" if kind == "surplus" else f" ({kind})"
    return (
        f"surplus{named}: {len(items)} smaller ones, {', '.join(volumes)}, up to {height:.3g} {unit} high, "
        f"{area:.3g} {unit}²"
    )


def _describe_surplus(item: Surplus, unit: str) -> str:
    volume = f"about {item.estimate:.2g} {unit}³ (estimate)" if item.volume is None else f"{item.volume:.3g} {unit}³"
    size = f"{item.height:.3g} {unit} high, {item.area:.3g} {unit}²"
    if item.kind == "surroundings":
        size = f"up to {item.height:.3g} {unit} from the part"
    words = [*([volume] if item.kind != "surroundings" else []), size, f"{item.share:.1%} of the scan"]
    named = "" if item.kind == "surplus" else f" ({item.kind})"
    notes = item.notes if item.kind == "surplus" else ()  # the others are among the warnings
    return f"surplus {item.id}{named}: {', '.join(words)}" + "".join(f"; {note}" for note in notes)
