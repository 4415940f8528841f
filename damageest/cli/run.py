"""`damageest run`: runs jobs, with progress on stderr and a table of the sites at the end."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from damageest.cli import _process
from damageest.cli._errors import describe_failure, say_error
from damageest.cli._json import AsJson, say_json
from damageest.cli._process import end_with_each
from damageest.cli._streams import keep_for_results, say, say_result
from damageest.errors import clean_message
from damageest.geometry.threads import use_threads
from damageest.isolation.limits import STAGE_SECONDS, Limits, limit_this_process, parse_memory
from damageest.isolation.notes import at_work, note_job

if TYPE_CHECKING:
    from damageest.findings import Sensor, Surplus
    from damageest.result import Result


Show = Callable[[str], None]
"""Prints one line."""
MOST_UNSEEN = 5
"""Unseen regions that are printed; result.json has all."""
MOST_SURPLUS = 3
"""Surpluses of a kind that are printed each by itself, largest first; result.json has all."""
UNSEEN_WHY = {
    "hidden": "hidden by the part from every scanner position",
    "outside": "outside every view",
    "no points": "in view, but without points",
    "earlier scan": "not in the earlier scan either",
}

IMPORT, IMPORT_SECONDS = "import of the pipeline", 120.0
"""The first step of a run, and after how many seconds it is ended. Without byte-code and from a slow disk it takes a
minute."""


def command(
    jobs: Annotated[list[Path], typer.Argument(metavar="JOB...", help="Job files.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Output folder; only with a single job. Default: out/<name>."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="Replace a value of the job: stage.option=value or field=value. May be repeated."),
    ] = None,
    no_cache: Annotated[bool, typer.Option("--no-cache", help="Compute all stages again.")] = False,
    as_json: AsJson = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only, no progress and no table.")] = False,
    memory: Annotated[
        str, typer.Option(metavar="SIZE", help="Memory that the run may allocate, as 6GB. Default: what is free.")
    ] = "",
    stage_timeout: Annotated[
        float, typer.Option(min=0, help="Seconds after which a stage is ended; 0: never.")
    ] = STAGE_SECONDS,
    threads: Annotated[
        int, typer.Option(min=0, metavar="N", help="Threads that the run uses; 0: one for each core.")
    ] = 0,
    debug: Annotated[bool, typer.Option("--debug", help="Show a traceback on errors.")] = False,
) -> None:
    """Run jobs: compute the damage volumes from part and scan."""
    if threads:
        use_threads(threads)
    limits = Limits(parse_memory(memory) if memory else None, stage_timeout)
    given = _Given(output, tuple(settings or ()), not no_cache, limits, as_json, quiet, debug)
    if output is not None and len(jobs) > 1:
        from damageest.errors import Fault, JobError

        raise JobError(
            [Fault("only valid with a single job; with several jobs, each job's own output folder is used")], "--output"
        )
    end_with_each(
        lambda first: _run_clean(jobs[first:], given),
        [str(path) for path in jobs],
        lambda error, source: _report_failure(error, source, as_json, debug),
    )


@dataclass(frozen=True)
class _Given:
    """The options of the command."""

    output: Path | None
    settings: tuple[str, ...]
    cache: bool
    limits: Limits
    as_json: bool
    quiet: bool
    debug: bool


def _run_clean(jobs: list[Path], given: _Given) -> int:
    """As `_run_jobs`; with --json nothing else is written to standard output, by whatever code."""
    with keep_for_results(given.as_json, for_good=_process.is_command):
        return _run_jobs(jobs, given)


def _run_jobs(jobs: list[Path], given: _Given) -> int:
    """Runs jobs one after the other, all in this process. Gives the exit status."""
    from damageest.cli import _interrupt
    from damageest.cli._progress import Progress
    from damageest.error_codes import format_help
    from damageest.errors import DamageestError
    from damageest.io.files import read_json
    from damageest.job import load
    from damageest.registry import Registry

    limit_this_process(given.limits.memory)
    progress = Progress(given.quiet, _process.BEGAN if _process.is_command else None)
    registry = Registry.discover([progress])
    status = 0
    loaded = []
    for path in jobs:  # every job is checked before the first one runs
        try:
            loaded.append(load(path, registry, given.settings))
        except DamageestError as error:
            status = max(status, _report_failure(error, str(path), given.as_json, given.debug))
    if status:
        return status
    for number, job in enumerate(loaded):
        note_job(number)
        output = given.output or job.output
        try:
            with progress.show_job(job.name):
                # after the first line: it takes time, and where memory ran out, OpenBLAS tries for ever
                with progress.show_step(IMPORT), at_work(IMPORT, IMPORT_SECONDS):
                    from damageest.api import run

                result = run(
                    job, output=given.output or True, cache=given.cache, registry=registry, limits=given.limits
                )
        except DamageestError as error:
            status = max(status, _report_failure(error, job.source, given.as_json, given.debug))
            continue
        except KeyboardInterrupt:
            _interrupt.text = progress.describe_kept(output)
            raise
        target = output.resolve()
        if given.as_json:
            say_result(json.dumps(read_json(target / "result.json")))
        elif not given.quiet:
            _print_table(result, target)
        if result.sites and not any(site.accepted for site in result.sites):
            status = max(status, 1)
            say(
                f"error: {job.source}: none of the sites is accepted as damage; see the reasons of each, and "
                "name those that are damage in the job:  accept: [1],  or  accept: all\n" + format_help("not_accepted"),
                err=True,
            )
        if result.failures:
            status = max(status, 1)
            for failure in result.failures if given.quiet or given.as_json else ():
                say(f"error: {failure}", err=True)
    return status


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
            f"unseen: {region.area:.4g} {unit}² near ({x:.4g}, {y:.4g}, {z:.4g}){why}; a loss of up to "
            f"{region.volume:.4g} {unit}³ there would not show"
        )
    if more := regions[MOST_UNSEEN:]:
        show(f"unseen: {len(more)} smaller regions, {sum(one.area for one in more):.4g} {unit}²")


def _describe_sensor(sensor: Sensor, unit: str) -> str:
    """The smallest loss that the scan can show, and why."""
    why = [f"noise {sensor.noise:.3g}"]
    if sensor.correlated > sensor.noise / 4:
        why.append(f"errors of {sensor.correlated:.3g} that regions of about {sensor.alike:.2g} share")
    if sensor.depth_step:
        why.append(f"depth in steps of {sensor.depth_step:.3g}")
    least = f"{sensor.least_depth:.3g} {unit} or narrower than {sensor.least_width:.2g} {unit}"
    return f"losses shallower than {least} cannot be seen in this scan ({', '.join(why)})"


def _report_failure(error: Exception, source: str, as_json: bool, debug: bool) -> int:
    import traceback

    status = int(getattr(error, "exit_status", 1))
    if as_json:
        say_json(describe_failure(error, source))
    if debug:
        traceback.print_exception(error)
    say_error(error)
    return status


def _print_table(result: Result, target: Path) -> None:
    """Prints the sites with the result of the check against the scan, notes, and the path of the output folder."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from damageest.findings import describe_interval
    from damageest.rules.advice import list_topics
    from damageest.rules.notes import cap_notes, list_notes, qualify_nothing

    console = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 160)

    def show(text: str, label: str = "", style: str = "") -> None:
        console.print(Text(label, style) + Text(clean_message(text)))  # no text is markup

    unit = result.units
    if result.sites:
        table = Table(title=None, box=None, pad_edge=False, header_style="bold")
        heads = ["site", f"volume {unit}³", f"area {unit}²", f"depth {unit}"]
        if any(site.deposit for site in result.sites):
            heads += [f"deposit {unit}³", f"stock {unit}³"]
        for name in (*heads, "95 %", "method", "verdict"):
            table.add_column(name, justify="left" if name in ("method", "verdict") else "right")
        for site in result.sites:
            verdict = site.verdict.level + ("" if site.accepted == (site.verdict.level != "doubtful") else ", accepted")
            numbers = [f"{site.damage.volume:.6g}", f"{site.surface.area:.6g}", f"{site.max_depth:.4g}"]
            if len(heads) > 4:
                stock = getattr(site.deposit, "stock_volume", None)
                numbers += [f"{site.deposit.volume:.6g}" if site.deposit else "–"]
                numbers += ["–" if stock is None else f"{stock:.6g}"]
            table.add_row(str(site.id), *numbers, describe_interval(site.volume_95), site.method, verdict)
        console.print(table)
        known = "" if result.volume_95 is None else f" (95 %: {describe_interval(result.volume_95)})"
        # what an earlier scan shows bounds no volume of its own
        whole = "" if result.part.unseen is not None else f"; part volume: {result.part.volume:.6g} {unit}³"
        show(f"damage volume: {result.damage_volume:.6g} {unit}³{known}{whole}")
        if result.not_in_budget:
            show(f"not known, and in no interval: {', '.join(result.not_in_budget)}")
    elif not result.failures:
        where = f"{_on_seen(result)}{qualify_nothing(result.warnings)}"
        show(f"no damage deeper than the tolerance of {result.tolerance:.4g} {unit} was found{where}")
        if result.pose.free and result.volume_95 and result.volume_95[1] > 0:
            most = f"{result.volume_95[1]:.4g} {unit}³"
            show(f"the pose is free: wear of up to {most} over a whole face would not show; see align.datum")
    _print_coverage(result, show)
    if result.sensor is not None:
        show(_describe_sensor(result.sensor, unit))
    if result.fit is not None and result.fit.model == "ok":  # otherwise it is among the notes
        show(f"fit: {result.fit.words}")
    for text in _list_surplus(result.surplus, unit):
        show(text)
    for text in result.failures:
        show(f" {text}", "failed:", "red")
    told = [str(note) for note in result.warnings if note.code == "report"]  # a file that is looked for: always said
    for text in [*cap_notes([text for text in list_notes(result) if text not in told]), *told]:
        show(f" {text}", "note:", "yellow")
    if topics := list_topics(result):
        show(f"help: damageest explain {' '.join(topics)}")
    show(f"written to {target}")


def _list_surplus(items: Sequence[Surplus], unit: str) -> list[str]:
    """A line for each of the largest of a kind, and one for the rest of them."""
    kinds = {kind: [item for item in items if item.kind == kind] for kind in ("surplus", "displaced piece")}
    small = {kind: some[MOST_SURPLUS:] for kind, some in kinds.items() if len(some) > MOST_SURPLUS}
    folded = {item.id for some in small.values() for item in some}
    lines = [_describe_surplus(item, unit) for item in items if item.id not in folded]
    return [*lines, *(_fold_surplus(kind, some, unit) for kind, some in small.items())]


def _fold_surplus(kind: str, items: Sequence[Surplus], unit: str) -> str:
    """One line for many surpluses of a kind, with the volume of those that are closed, and an estimate for others."""
    closed = [item.volume for item in items if item.volume is not None]
    guessed = sum(item.estimate for item in items if item.volume is None)
    volumes = [f"{sum(closed):.4g} {unit}³ together"] if closed else []
    if left := len(items) - len(closed):
        which = f"{left} of them without a closed volume" if closed else "no closed volume"
        volumes.append(f"{which}, about {guessed:.2g} {unit}³ (an estimate: area times mean height)")
    height, area = max(item.height for item in items), sum(item.area for item in items)
    named = "" if kind == "surplus" else f" ({kind})"
    return (
        f"surplus{named}: {len(items)} smaller ones, {', '.join(volumes)}, up to {height:.4g} {unit} high, "
        f"{area:.4g} {unit}²"
    )


def _describe_surplus(item: Surplus, unit: str) -> str:
    volume = f"about {item.estimate:.2g} {unit}³ (an estimate)" if item.volume is None else f"{item.volume:.6g} {unit}³"
    size = f"{item.height:.4g} {unit} high, {item.area:.4g} {unit}²"
    if item.kind == "surroundings":
        size = f"up to {item.height:.4g} {unit} from the part"
    words = [*([volume] if item.kind != "surroundings" else []), size, f"{item.share:.1%} of the scan"]
    named = "" if item.kind == "surplus" else f" ({item.kind})"
    notes = item.notes if item.kind == "surplus" else ()  # the others are among the warnings
    return f"surplus {item.id}{named}: {', '.join(words)}" + "".join(f"; {note}" for note in notes)
