"""The rows of all cases: several run at the same time, and a JSON Lines file keeps the rows to resume from."""

from __future__ import annotations

import contextlib
import json
import uuid
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol

from damageest.batches.cluster import open_client
from damageest.batches.tasks import run_tasks
from damageest_evaluate.processes import Row, run_in_process


class EvaluationCase(Protocol):
    """A case that can be run in a process of its own. ``varied``: the values under which it is listed."""

    @property
    def varied(self) -> Mapping[str, float | str]: ...

    def compute_key(self) -> str:
        """The case's identifier in a file of rows."""
        ...

    def make_blank_row(self) -> Row:
        """The row of the case without a result."""
        ...

    def run(self) -> Row:
        """Runs the case and gives its row."""
        ...


def run_all(
    cases: Sequence[EvaluationCase],
    out: Path | None,
    jobs: int,
    timeout: float,
    tell: Callable[[Row], None],
    scheduler: str = "",
) -> list[Row]:
    """The rows of all cases, in the order of the cases.

    Rows that the file ``out`` already holds are read from it. New rows are appended to it. The cases run on Dask: at
    most ``jobs`` at a time on this machine, or on the cluster whose ``scheduler`` has this address. ``tell`` is called
    with each row.
    """
    rows_by_key = {row["key"]: row for row in read_rows(out)}
    waiting = {case.compute_key(): case for case in cases if case.compute_key() not in rows_by_key}
    for row in _collect_rows(cases, rows_by_key):
        tell(row)
    if not waiting:
        return _collect_rows(cases, rows_by_key)
    tasks = {key: (case, timeout) for key, case in waiting.items()}
    # each case starts a process of its own, so threads are enough here
    token = f"damageest-{uuid.uuid4().hex[:8]}"
    with (
        open_client(scheduler, jobs, processes=False) as client,
        contextlib.closing(run_tasks(client, run_one, tasks, token)) as steps,
    ):
        for task in (task for ended, _ in steps for task in ended):
            row = task.value or waiting[task.name].make_blank_row() | {"error": task.why}
            rows_by_key[row["key"]] = row
            tell(row)
            if out:
                with out.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(row) + "\n")
    return _collect_rows(cases, rows_by_key)


def _collect_rows(cases: Sequence[EvaluationCase], rows_by_key: Mapping[str, Row]) -> list[Row]:
    """The stored rows in the order of the cases, each with the ``varied`` of its case, which may have changed."""
    return [
        rows_by_key[case.compute_key()] | {"varied": dict(case.varied)}
        for case in cases
        if case.compute_key() in rows_by_key
    ]


def run_one(case: EvaluationCase, timeout: float) -> Row:
    """The case's row. A crash or a timeout gives a row with ``error``, not flagged."""
    row = run_in_process(_run, {"case": case}, timeout)
    return row if isinstance(row, dict) else case.make_blank_row() | {"error": row, "seconds": timeout}


def _run(case: EvaluationCase) -> Row:
    return case.run()


def read_rows(out: Path | None) -> list[Row]:
    """The complete rows of a file. A truncated row, left by a run that was killed, is removed from the file."""
    if out is None or not out.is_file():
        return []
    rows, lines = [], out.read_text(encoding="utf-8").splitlines(keepends=True)
    for text in lines:
        with contextlib.suppress(ValueError, RecursionError):
            rows.append(json.loads(text))
    if len(rows) < len(lines) or (lines and not lines[-1].endswith("\n")):
        out.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    return rows
