"""The run of the open job, as the page shows it: progress, its end, and how it is stopped."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from damageest_app.running.runner import Outcome, Progress, Runner, describe_end

if TYPE_CHECKING:
    from damageest_app.session import Session

TICK = 0.5
"""Seconds between two looks at the clock."""


class Runs:
    """At most one run at a time. ``hold`` keeps the server up while nobody looks, ``release`` lets it end again."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.runner = Runner(self._tell)
        self.was_stopped = False
        self.hold: Callable[[], None] = lambda: None
        self.release: Callable[[], None] = lambda: None
        self._loop: asyncio.AbstractEventLoop | None = None

    def start(self) -> None:
        """Runs the job; the page stays alive."""
        self.session.spawn(self.run())

    def stop(self) -> None:
        """Ends the run with all its processes."""
        self.runner.stop()

    async def run(self, then: str = "judge") -> None:
        """Runs the job as `damageest run` does, and shows step ``then`` when it is done."""
        session, state = self.session, self.session.state
        if session.job is None or self.runner.is_busy:
            return
        output = session.find_output()
        if output is None:
            where = session.folder.path
            session.say(f"the output of the job lies outside of {where}; the app writes below it only", "error")
            return
        self._loop = asyncio.get_running_loop()
        words = ["run", str(session.job.path), "--quiet"]
        with state:
            state.update({"running": True, "share": 0.0, "doing": "start of the program", "stages": [], "message": ""})
        before = _read_stamp(output)
        clock = asyncio.ensure_future(self._tick())
        try:
            outcome = await asyncio.to_thread(self.runner.call, words, session.folder.path)
        except OSError as error:
            outcome = Outcome(1, f"error: the run cannot be started: {error.strerror or error}", 0.0)
        finally:
            clock.cancel()
            self.release()
            state.running = False
        with state:
            state.update({"seconds": round(outcome.seconds, 1), "doing": self.runner.progress.doing})
            self._show_end(outcome, _read_stamp(output) != before, then)

    def _show_end(self, outcome: Outcome, is_new: bool, then: str) -> None:
        session = self.session
        text = describe_end(outcome, self.runner.progress.doing)
        self.was_stopped = outcome.stopped
        if is_new:
            session.load_results()
            session.refresh()
            session.go(then)
            session.warm()
        if text:
            session.say(text, "warning" if outcome.stopped or is_new else "error")

    async def _tick(self) -> None:
        state = self.session.state
        while True:
            await asyncio.sleep(TICK)
            self.hold()  # a run that nobody looks at goes on to its end
            with state:
                state.seconds = round(state.seconds + TICK, 1) if state.share else TICK
                state.share = max(state.share, 0.01)

    def _tell(self, progress: Progress) -> None:
        """Called from the thread that follows the run."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._show, progress)

    def _show(self, progress: Progress) -> None:
        state = self.session.state
        with state:
            state.doing, state.share = progress.doing, progress.share
            state.stages = [dict(one) for one in progress.stages]


def _read_stamp(output: Path) -> int:
    """When the result was written; 0 where there is none."""
    try:
        return (output / "result.json").stat().st_mtime_ns
    except OSError:
        return 0
