"""Progress of a run on stderr: on a terminal a line with the current stage, and a line for each finished stage."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.status import Status

from damageest.registry.hookspecs import hookimpl


class Progress:
    """Observes the stages through hooks and prints them, unless ``quiet``."""

    def __init__(self, quiet: bool) -> None:
        self.console = Console(stderr=True, quiet=quiet, highlight=False, soft_wrap=True)
        self.status: Status | None = None

    @contextmanager
    def show_job(self, name: str) -> Iterator[None]:
        """Shows the progress of one job while the ``with`` block runs."""
        self.console.print(f"[bold]{name}[/bold]")
        with self.console.status("reading") as self.status:
            yield
        self.status = None

    @hookimpl
    def damageest_before_stage(self, stage: str, use: str, site: int) -> None:
        if self.status:
            self.status.update(_format_label(stage, use, site))

    @hookimpl
    def damageest_after_stage(self, stage: str, use: str, site: int, seconds: float, cached: bool) -> None:
        took = "from an earlier run" if cached else f"{seconds:6.2f} s"
        self.console.print(f"  {_format_label(stage, use, site):<40} {took}")

    @hookimpl
    def damageest_stage_failed(self, stage: str, use: str, site: int) -> None:
        self.console.print(f"  {_format_label(stage, use, site):<40} [red]failed[/red]")


def _format_label(stage: str, use: str, site: int) -> str:
    return f"{stage}: {use}" + (f", site {site}" if site else "")
