"""`python -m damageest` is the command `damageest`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_it_says_the_same_as_the_command() -> None:
    command = Path(sys.executable).with_name("damageest")
    said = [
        subprocess.run([*words, "run", "--help"], capture_output=True, text=True, check=True).stdout
        for words in ([sys.executable, "-m", "damageest"], [str(command)] if command.exists() else [])
        if words
    ]
    assert said[0].lstrip().startswith("Usage: damageest run")
    assert len(set(said)) == 1
