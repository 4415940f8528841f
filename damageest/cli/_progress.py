"""Progress of a run on stderr.

On a terminal: a live line with the current stage, with a bar where it takes longer than a second, and a line for each
finished stage. In a pipe: a line for each call of a stage, whose name is written when it begins, so that a crash or a
hang shows where. What takes time between the stages has lines too, and the last line is the whole run: together they
say where its time went.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import Progress as Live
from rich.progress import ProgressColumn, SpinnerColumn, Task, TextColumn
from rich.progress_bar import ProgressBar
from rich.text import Text

from damageest.artefacts import Enclosures, Scan, Sites
from damageest.errors import clean_message
from damageest.registry.hookspecs import hookimpl

SECONDS = {"sample": 0.3, "align": 4.0, "segment": 0.4, "cluster": 0.2, "enclose": 3.0, "export": 0.4, "report": 0.6}
"""About how long a stage takes for 100,000 scan points, on one core; measured on the example jobs."""
LONG = 1.0
"""Seconds from which on a stage has a bar."""
SHOWN = 0.05
"""Seconds from which on what is no stage has a line of its own."""
APART = 5.0
"""Seconds between the lines, in a pipe, for parts of a stage's work."""
IDLE = {("allowance", "none"), ("path", "none"), ("report", "none")}
"""Stages with implementations that do nothing. They are not listed; result.json has them."""


class _Bar(ProgressColumn):
    """How far a stage is, by the time it usually takes; it stays short of the end until the stage is done."""

    max_refresh = 0.2

    def render(self, task: Task) -> ProgressBar | Text:
        usual, elapsed = task.fields.get("usual", 0.0), task.elapsed or 0.0
        if not usual or elapsed < LONG:
            return Text("")
        return ProgressBar(total=1.0, completed=min(elapsed / usual, 0.97), width=24)


class _Clock(ProgressColumn):
    """Seconds so far, and about how many there will be."""

    max_refresh = 0.2

    def render(self, task: Task) -> Text:
        usual, elapsed = task.fields.get("usual", 0.0), task.elapsed or 0.0
        if elapsed < LONG:
            return Text("")
        return Text(f"{elapsed:.0f} s" + (f" of about {usual:.0f} s" if usual >= elapsed else ""))


class Progress:
    """Observes the stages through hooks and prints them, unless ``quiet``."""

    def __init__(self, quiet: bool, began: float | None = None) -> None:
        """``began``: when the program was started, on the clock of `time.perf_counter`; its start has a line then."""
        self.began = began
        self.console = Console(stderr=True, quiet=quiet, highlight=False, soft_wrap=True)
        self.live: Live | None = None
        self.points = self.sites = 0
        self.finished: list[str] = []
        self.current = ""
        self.is_idle = False
        self.told = 0.0
        self._begin_group("", "")

    @contextmanager
    def show_job(self, name: str) -> Iterator[None]:
        """Shows the progress of one job while the ``with`` block runs."""
        self.points = self.sites = 0
        self.finished, self.current = [], ""
        self.console.print(Text(clean_message(name), style="bold"))
        first, self.listed = time.perf_counter() if self.began is None else self.began, 0.0
        if self.began is not None:
            self._print_line("start of the program", time.perf_counter() - self.began)
            self.began = None  # of the first job alone
        with self._show_live():
            yield
        whole = time.perf_counter() - first
        self._print_line("rest", whole - self.listed)
        self.console.print(f"  {'the whole run':<40} {whole:6.2f} s")

    @contextmanager
    def show_step(self, label: str) -> Iterator[None]:
        """Prints a line for what the ``with`` block does, where it takes time."""
        before = time.perf_counter()
        yield
        self._print_line(label, time.perf_counter() - before)

    @contextmanager
    def _show_live(self) -> Iterator[None]:
        if not self.console.is_terminal:
            yield
            return
        columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), _Bar(), _Clock())
        with Live(*columns, console=self.console, transient=True) as self.live:
            try:
                yield
            finally:
                self._print_group()
        self.live = None

    def describe_kept(self, target: Path) -> str:
        """After an interrupt: where, and what of the run is kept."""
        if self.live is None and self.current and not self.console.quiet:
            sys.stderr.write("\n")
        where = f"interrupted in {self.current}" if self.current else "interrupted"
        kept = ", ".join(dict.fromkeys(self.finished))
        if not kept:
            return f"{where}; no stage had finished, and nothing is kept"
        return f"{where}; kept in {target / 'stages'}: {kept}; the same command continues after them"

    @hookimpl
    def damageest_before_stage(self, stage: str, use: str, site: int) -> None:
        self.is_idle = (stage, use) in IDLE
        if self.is_idle:
            return
        label = self.current = _format_label(stage, use, site)
        self.told = time.perf_counter()
        if self.live is None:
            if not self.console.quiet:
                sys.stderr.write(f"  {label:<40} ")
                sys.stderr.flush()
            return
        if (stage, use) != self.group:
            self._print_group()
            self._begin_group(stage, use)
        of = f" of {self.sites}" if site and self.sites >= site else ""
        self._show(label + of, 0.0 if site else SECONDS.get(stage, 0.0) * self.points / 1e5)

    @hookimpl
    def damageest_part_begins(self, what: str) -> None:
        """On a terminal the live line says what is at work; in a pipe a new part is listed after `APART` seconds."""
        if self.live is not None:
            for task in self.live.tasks:
                self.live.update(task.id, description=f"{self.current} ({clean_message(what)})")
        elif time.perf_counter() - self.told >= APART and not self.console.quiet:
            self.told = time.perf_counter()
            sys.stderr.write(f"\n    {clean_message(what):<38} ")
            sys.stderr.flush()

    @hookimpl
    def damageest_after_stage(self, stage: str, site: int, output: object, seconds: float, cached: bool) -> None:
        if self.is_idle:
            return
        self.points = len(output.points) if isinstance(output, Scan) else self.points
        self.sites = output.count if isinstance(output, Sites) else self.sites
        self.sites = len(output.items) if isinstance(output, Enclosures) else self.sites
        if stage not in ("export", "report"):
            self.finished.append(stage)
        self.current = ""
        self._end_call("from an earlier run" if cached else f"{seconds:6.2f} s")
        self.seconds += seconds
        self.listed += seconds
        self.cached += cached
        if self.live and not site:
            self._print_group()
            self._show(f"checks after {stage}", 0.0)

    @hookimpl
    def damageest_after_step(self, step: str, seconds: float) -> None:
        if seconds >= SHOWN:
            if self.live:
                self._print_group()
            self._print_line(step, seconds)

    def _print_line(self, what: str, seconds: float) -> None:
        """A line for what is no stage, where it took long enough."""
        if seconds >= SHOWN:
            self.listed += seconds
            self.console.print(Text(f"  {what:<40} {seconds:6.2f} s"))

    def _show(self, text: str, usual: float) -> None:
        """Begins a new live line; ``usual``: about how many seconds it stays, 0 where that is not known."""
        if self.live is None:
            return
        for task in self.live.task_ids:
            self.live.remove_task(task)
        self.live.add_task(text, total=None, usual=usual)

    @hookimpl
    def damageest_stage_failed(self, stage: str, use: str, site: int) -> None:
        self._end_call("failed")
        self.failed += 1

    def _end_call(self, text: str) -> None:
        self.calls += 1
        if self.live is None and not self.console.quiet:
            sys.stderr.write(f"{text}\n")

    def _begin_group(self, stage: str, use: str) -> None:
        """A group is the calls of one stage, one after the other, for all sites."""
        self.group = (stage, use)
        self.calls = self.cached = self.failed = 0
        self.seconds = 0.0

    def _print_group(self) -> None:
        if not self.calls:
            return
        took = "from an earlier run" if self.cached == self.calls else f"{self.seconds:6.2f} s"
        label = _format_label(*self.group, 0) + (f", {self.calls} sites" if self.calls > 1 else "")
        failed = Text(f"  {self.failed} failed" if self.calls > 1 else "failed", style="red") if self.failed else Text()
        self.console.print(Text(f"  {label:<40} {took if self.calls > self.failed else ''}") + failed)
        self._begin_group("", "")


def _format_label(stage: str, use: str, site: int) -> str:
    return clean_message(f"{stage}: {use}") + (f", site {site}" if site else "")
