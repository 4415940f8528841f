"""Runs in processes of their own, some at a time; rows kept in a file of JSON lines, to go on from."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damageest.evaluate._case import Case

MARK = "@row "
"""What a process writes before its row, to tell it from whatever libraries print."""

Row = dict[str, Any]


def apart(module: str, what: Row, timeout: float) -> Row | str:
    """The row that ``python -m module`` gives for ``what``; a sentence where it crashed or took too long."""
    command = [sys.executable, "-m", module, json.dumps(what)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        return f"not done after {timeout:g} s"
    for text in done.stdout.splitlines():
        if text.startswith(MARK):
            row: Row = json.loads(text.removeprefix(MARK))
            return row
    said = done.stderr.strip().splitlines()
    return f"crashed ({done.returncode}): {said[-1] if said else ''}"


def run_all(
    wanted: Sequence[Case], out: Path | None, jobs: int, timeout: float, tell: Callable[[Row], None]
) -> list[Row]:
    """The rows of all cases in their order; those that the file ``out`` has are taken from there, new ones appended."""
    known = {row["key"]: row for row in read(out)}
    waiting = {case.key(): case for case in wanted if case.key() not in known}
    for row in _named(wanted, known):
        tell(row)
    with ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(_row, case, timeout) for case in waiting.values()]
        try:
            for future in as_completed(futures):
                row = future.result()
                known[row["key"]] = row
                tell(row)
                if out:
                    with out.open("a") as stream:
                        stream.write(json.dumps(row) + "\n")
        except BaseException:  # Ctrl-C: what has not begun does not begin
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return _named(wanted, known)


def _named(wanted: Sequence[Case], known: Mapping[str, Row]) -> list[Row]:
    """The known rows in the order of their cases; what they stand for in the tables is up to the run."""
    return [known[case.key()] | {"varied": dict(case.varied)} for case in wanted if case.key() in known]


def _row(case: Case, timeout: float) -> Row:
    """The case's row; a crash or a timeout is a row with an error, not flagged."""
    from damageest.evaluate._case import blank

    row = apart("damageest.evaluate._case", asdict(case), timeout)
    return row if isinstance(row, dict) else blank(case) | {"error": row, "seconds": timeout}


def read(out: Path | None) -> list[Row]:
    """The whole rows of a file; one cut short, as by a run that was killed, is dropped from it."""
    if out is None or not out.is_file():
        return []
    rows, lines = [], out.read_text().splitlines(keepends=True)
    for text in lines:
        with contextlib.suppress(json.JSONDecodeError):
            rows.append(json.loads(text))
    if len(rows) < len(lines) or (lines and not lines[-1].endswith("\n")):
        out.write_text("".join(json.dumps(row) + "\n" for row in rows))
    return rows
