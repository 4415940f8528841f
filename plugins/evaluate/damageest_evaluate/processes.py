"""One run in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

MARK = "@row "
"""Prefix of the line with the row. It separates the row from anything that libraries print."""

Row = dict[str, Any]


def run_in_process(module: str, inputs: Row, timeout: float) -> Row | str:
    """The row that ``python -m module`` prints for ``inputs``; a message if it crashed or exceeded ``timeout``."""
    command = [sys.executable, "-m", module, json.dumps(inputs)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        return f"stopped: not finished after {timeout:g} s"
    for text in done.stdout.splitlines():
        if text.startswith(MARK):
            row: Row = json.loads(text.removeprefix(MARK))
            return row
    messages = done.stderr.strip().splitlines()
    return f"the process crashed with exit status {done.returncode}: {messages[-1] if messages else 'no message'}"
