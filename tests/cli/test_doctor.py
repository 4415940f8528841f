"""`damageest doctor`: what it finds is there, and what is wrong ends with exit status 1. Completion by the shell."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from damageest import __version__
from damageest.cli import app, doctor
from damageest.errors import describe_install


@pytest.mark.slow
def test_a_sound_installation_gives_the_true_volume() -> None:
    done = CliRunner().invoke(app, ["doctor", "--json"])
    found = json.loads(done.stdout)
    assert found["plugins"][0] == f"damageest {__version__}"
    assert "true 452.4 mm³" in found["self_test"]
    assert found["packages"]["numpy"][0].isdigit()
    # a plugin may lack a library of this system; nothing else is wrong
    assert all("system library" in fault for fault in found["faults"])
    assert done.exit_code == (1 if found["faults"] else 0)


def test_a_wrong_volume_and_a_missing_extra_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("damageest.api.run", lambda job: SimpleNamespace(damage_volume=261.8))
    monkeypatch.setattr(doctor, "_has", lambda extra: extra != "report")
    monkeypatch.setattr("damageest.cli._trials.try_plugins", lambda *given, **named: (0, []))
    done = CliRunner().invoke(app, ["doctor"])
    assert done.exit_code == 1
    assert "fault: the self-test gave a wrong volume" in done.output
    assert f"extra report: not installed; {describe_install('report')}" in done.output


@pytest.mark.slow
def test_the_shell_is_told_the_commands_that_a_word_begins(tmp_path: Path) -> None:
    asked = {"COMP_WORDS": "damageest do", "COMP_CWORD": "1", "_DAMAGEEST_COMPLETE": "complete_bash"}
    command = [sys.executable, "-c", "import sys; sys.argv[0] = 'damageest'; from damageest.cli import main; main()"]
    done = subprocess.run(
        command, env={**os.environ, **asked}, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["doctor"]
