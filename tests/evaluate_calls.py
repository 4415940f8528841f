"""Calls of the command line in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from damageest_evaluate.case import TIMES


def evaluate(*words: object) -> subprocess.CompletedProcess[str]:
    code = "from damageest.cli import main; main()"
    command = [sys.executable, "-c", code, "evaluate", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def rows_of(folder: Path) -> dict[str, dict[str, Any]]:
    """The rows of a run by their key."""
    return {row["key"]: row for row in map(json.loads, (folder / "cases.jsonl").read_text().splitlines())}


def timeless(row: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name not in TIMES}
