"""Progress of a run in a notebook: one line below the cell, written anew at each stage."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from html import escape
from typing import Any

from damageest.pipeline.watch import Progress

WIDTH = 40
"""Marks of the bar."""


def find_notebook() -> Callable[[Progress], None] | None:
    """What shows progress in the notebook that this process is the kernel of; None elsewhere."""
    shell = sys.modules.get("IPython")
    kernel: Any = shell.get_ipython() if shell is not None and hasattr(shell, "get_ipython") else None
    return show_in(kernel) if kernel is not None and type(kernel).__name__ == "ZMQInteractiveShell" else None


def show_in(kernel: Any) -> Callable[[Progress], None]:
    """A function that shows progress by the display hook of a kernel."""
    shown: Any = importlib.import_module("IPython.display")
    handle = shown.display(shown.HTML("<code>damageest</code>"), display_id=True)

    def show(now: Progress) -> None:
        what = f"{now.stage}: {now.use}" if now.use else now.stage
        what += f", site {now.site}" if now.site else ""
        what += f" ({now.part})" if now.part else ""
        done = round(WIDTH * now.share)
        bar = "█" * done + "░" * (WIDTH - done)
        handle.update(shown.HTML(f"<code>{bar} {now.share:4.0%} {now.seconds:5.1f} s  {escape(what)}</code>"))

    return show
