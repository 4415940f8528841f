"""What a message tells a user to type adds what is missing, wherever damageest was installed."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from damageest.artefacts import Reason
from damageest.errors import EXTRAS, describe_install, describe_pip_install
from damageest.findings import describe_interval, describe_volume
from damageest.registry import bundled

ROOT = Path(__file__).parents[1]


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A clone as the README sets it up: uv in a folder of its own and not on the path."""
    (tmp_path / "plugins").mkdir()
    (tmp_path / ".uv/bin").mkdir(parents=True)
    (tmp_path / ".uv/bin/uv").touch(mode=0o755)
    (tmp_path / ".venv").mkdir()
    monkeypatch.setattr(sys, "prefix", str(tmp_path / ".venv"))
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    monkeypatch.delenv("UV_PROJECT_ENVIRONMENT", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_in_a_clone_uv_is_named_as_it_can_be_typed(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sync = "sync --inexact --no-dev"
    assert describe_install("damageest-paths", clone) == f".uv/bin/uv {sync} --package damageest-paths"
    assert describe_install("pdf", clone) == f".uv/bin/uv {sync} --extra pdf"
    assert describe_pip_install("wanted", clone) == ".uv/bin/uv pip install wanted"
    (clone / "jobs").mkdir()
    monkeypatch.chdir(clone / "jobs")
    assert describe_install("pdf", clone) == f"{clone}/.uv/bin/uv {sync} --project {clone} --extra pdf"
    (clone / "uv").touch(mode=0o755)
    monkeypatch.setenv("PATH", str(clone))
    assert describe_install("pdf", clone) == f"uv {sync} --project {clone} --extra pdf"


def test_elsewhere_pip_is_named(clone: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sys, "prefix", "/usr")
    assert describe_install("damageest-paths", clone) == f'pip install -e "{clone}/plugins/paths"'
    assert describe_install("pdf", clone) == f'pip install -e "{clone}[pdf]"'
    assert describe_install("damageest-paths", tmp_path / "site-packages") == "pip install damageest-paths"
    assert describe_install("pdf", tmp_path / "site-packages") == 'pip install "damageest[pdf]"'


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*bundled.PACKAGES, *EXTRAS.values()}))
def test_the_command_that_is_named_works_here(name: str) -> None:
    """uv knows every package and extra that is named, and takes nothing away that is there."""
    uv = os.environ.get("UV") or shutil.which("uv")
    if uv is None or not (ROOT / "uv.lock").is_file() or Path(sys.prefix).resolve() != (ROOT / ".venv").resolve():
        pytest.skip("needs uv, a lock file and the environment of the clone")
    words = shlex.split(describe_install(name))
    assert words[1] == "sync"
    done = subprocess.run(
        [uv, *words[1:], "--dry-run", "--frozen", "--offline"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    gone, come = ({line.split()[1].split("==")[0] for line in done.stderr.splitlines() if line.startswith(sign)}
                  for sign in (" - ", " + "))  # fmt: skip
    assert gone <= come, "what is built anew comes again"


@pytest.mark.parametrize(
    ("volume", "interval", "said"),
    [
        (5962.32, (5949.0, 5970.0), "5962"),
        (5962.08, (5949.0, 5970.0), "5962"),
        (49432.84, (49430.5, 49434.5), "49432.8"),
        (12345.6, (8000.0, 16000.0), "12300"),
        (0.53219, (0.51, 0.55), "0.532"),
        (451.4123, None, "451.4"),
        (451.4123, (80.0, float("inf")), "450"),
        (0.0, (0.0, 0.0), "0"),
    ],
)
def test_a_volume_is_told_with_the_digits_that_its_interval_bears(
    volume: float, interval: tuple[float, float] | None, said: str
) -> None:
    assert describe_volume(volume, interval) == said


@pytest.mark.parametrize(
    ("interval", "said"),
    [
        (None, "–"),
        ((5948.6, 5970.4), "5949 to 5970"),
        ((538.6, 8000.0), "500 to 8000"),
        ((0.0, 46010.0), "0 to 46000"),
        ((637.9, float("inf")), "at least 640"),
        ((0.512, 0.556), "0.512 to 0.556"),
        ((12.0, 12.0), "12.00 to 12.00"),
    ],
)
def test_an_interval_is_told_with_two_digits_of_half_its_width(interval: tuple[float, float] | None, said: str) -> None:
    assert describe_interval(interval) == said


def test_a_reason_has_no_exponents_and_its_remedy_is_a_sentence() -> None:
    assert str(Reason("beside", "up to 4.601e+04 mm³ lost", remedy="scan again")) == "up to 46010 mm³ lost. Scan again"
    assert str(Reason("align", "it is free", remedy="align: none")) == "it is free. align: none"
    for command in ('pip install "damageest[report]"', "uv sync --all-extras", "damageest doctor"):
        assert str(Reason("report", "no page", remedy=command)) == f"no page. {command}"
    assert str(Reason("align", "a/1e+05/1.2e+05.ply stays")) == "a/1e+05/1.2e+05.ply stays"
