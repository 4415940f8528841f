"""`damageest doctor`: what it finds is there, and what is wrong ends with exit status 1."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from damageest import __version__
from damageest.cli import app, doctor


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
    monkeypatch.setattr(doctor, "JOB", doctor.JOB.replace("radius: 6.0", "radius: 5.0"))
    monkeypatch.setattr(doctor, "_has", lambda extra: extra != "report")
    done = CliRunner().invoke(app, ["doctor"])
    assert done.exit_code == 1
    assert "fault: the self-test gave a wrong volume" in done.output
    assert 'extra report: not installed; pip install "damageest[report]"' in done.output
