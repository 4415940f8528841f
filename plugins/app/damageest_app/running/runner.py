"""Runs `damageest run` in a process of its own, follows its progress, and ends it when asked."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from damageest_app.running.events import PIPE

LEASH = "DAMAGEEST_APP_LEASH"
"""The environment variable with the number of a pipe whose other end the app holds open as long as it lives."""
_MAIN = f"""import os
from damageest.isolation import end_with_parent
end_with_parent(int(os.environ.pop("{LEASH}")))
from damageest.cli import main
main()"""
COMMAND = (sys.executable, "-c", _MAIN)
"""The command line of this installation, as a process that ends with the app, however that ends."""
SHARES = {
    "part": 2, "scan": 3, "sample": 3, "align": 20, "adapt": 4, "segment": 2, "cluster": 1, "reconstruct": 5,
    "boundary": 1, "background": 1, "enclose": 25, "repair": 1, "boolean": 3, "allowance": 5, "path": 20, "export": 3,
    "report": 6,
}  # fmt: skip
"""The stages in the order of a run, with about the share of its time that each takes."""


@dataclass
class Progress:
    """How far a run is. ``doing``: in words; ``stages``: those that are done, with seconds; ``share`` of the whole, 0
    to 1."""

    doing: str = "start of the program"
    stages: list[dict[str, Any]] = field(default_factory=list)
    share: float = 0.0
    began: float = field(default_factory=time.monotonic)

    def take(self, event: dict[str, Any]) -> None:
        """Takes an event of the run."""
        kind, stage = event["kind"], str(event.get("stage", event.get("step", "")))
        site = f", site {event['site']}" if event.get("site") else ""
        if kind == "begin":
            self.doing = f"{stage}: {event['use']}{site}"
            self.share = max(self.share, _share_before(stage))
            return
        name = stage.replace("_", " ") + site
        if kind == "end" or event["seconds"] >= 0.05:
            self.stages.append({"name": name, "seconds": event["seconds"], "cached": event.get("cached", False)})
        self.doing = f"checks after {name}"


def _share_before(stage: str) -> float:
    names = list(SHARES)
    if stage not in names:
        return 0.0
    return sum(list(SHARES.values())[: names.index(stage)]) / sum(SHARES.values())


@dataclass(frozen=True)
class Outcome:
    """How a command ended. ``status``: 0 done, 1 a stage failed or refused, or no site is accepted, 2 the job or an
    input is not valid; ``messages``: what it said, without progress; ``stopped``: it was ended by the person."""

    status: int
    messages: str
    seconds: float
    stopped: bool = False
    printed: str = ""


class Runner:
    """At most one command at a time. ``tell`` is called from a thread after each event."""

    def __init__(self, tell: Callable[[Progress], None] = lambda _: None) -> None:
        self.progress = Progress()
        self._tell = tell
        self._process: subprocess.Popen[str] | None = None
        self._stopped = False

    @property
    def is_busy(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def call(self, words: Sequence[str], folder: Path) -> Outcome:
        """Runs `damageest WORDS` in a folder, and waits for its end."""
        if self.is_busy:
            raise RuntimeError("a run is in progress")
        self.progress, self._stopped = Progress(), False
        ours, theirs = os.pipe()
        leash, held = os.pipe()
        try:
            self._process = process = subprocess.Popen(
                [*COMMAND, *words],
                cwd=folder,
                env={**os.environ, PIPE: str(theirs), LEASH: str(leash)},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                pass_fds=(theirs, leash),
                start_new_session=True,  # so that all of its processes can be ended
            )
        except OSError:
            os.close(held)
            raise
        finally:
            os.close(theirs)
            os.close(leash)
        reader = threading.Thread(target=self._follow, args=(ours,), daemon=True)
        reader.start()
        printed, said = process.communicate()
        os.close(held)
        reader.join(timeout=2)
        seconds = time.monotonic() - self.progress.began
        return Outcome(process.returncode, said.strip(), seconds, self._stopped, printed)

    def stop(self) -> None:
        """Ends the command with all its processes."""
        if self._process is not None and self.is_busy:
            self._stopped = True
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def _follow(self, pipe: int) -> None:
        with os.fdopen(pipe, encoding="utf-8", errors="replace") as lines:
            for line in lines:
                with suppress(ValueError, KeyError, TypeError):
                    self.progress.take(json.loads(line))
                    self._tell(self.progress)


def describe_end(outcome: Outcome, doing: str) -> str:
    """What a person reads where a run did not end well; empty where it did."""
    if outcome.stopped:
        return f"stopped in {doing}; finished stages are kept, and the next run continues there"
    if outcome.status == 0:
        return ""
    if outcome.messages:
        return outcome.messages
    how = f"by signal {-outcome.status}" if outcome.status < 0 else f"with status {outcome.status}"
    return f"the run ended {how} in {doing}, without a message"
