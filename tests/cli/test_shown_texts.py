"""Texts of others, as of plugins and file names, are shown as they are: no markup, no control characters, no end."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from damageest.artefacts import Reason
from damageest.cli._run_table import print_table
from damageest.result import Result
from tests.cli.calls import call
from tests.cli.test_watched_stages import FAULTY, write_job
from tests.registry.test_registry import Site, site

__all__ = ["site"]

HARMFUL = "[/red] [bold]x :bomb: \x1b[31mred\x1b]0;title\x07 \x9b2J ‮back"
SHOWN = r"[/red] [bold]x :bomb: \x1b[31mred\x1b]0;title\x07 \x9b2J \u202eback"


@pytest.mark.parametrize("way", ["error", "library"])
def test_texts_of_plugins_are_shown_as_they_are(way: str, site: Site, small_done: Path) -> None:
    site.add("acme-bad", FAULTY)
    raised = {
        "error": f"from damageest.errors import StageError; raise StageError({HARMFUL!r} + 'x' * 50_000_000)",
        "library": f"raise ValueError({HARMFUL!r} + 'x' * 50_000_000)",
    }
    status, said = call("run", write_job(small_done.parent, "harmful", raised[way]))
    assert status == 1
    assert SHOWN in said, said[:2000]
    assert not [one for one in said if one in "\x1b\x07\x9b\u202e"]
    assert len(said) < 100_000


def test_notes_and_failures_are_shown_as_they_are(
    tmp_path: Path, small_result: Result, capsys: pytest.CaptureFixture[str]
) -> None:
    notes = (Reason("x", HARMFUL), Reason("y", "x" * 50_000_000))
    told = replace(small_result, warnings=notes, failures=(HARMFUL,))
    print_table(told, tmp_path / "final [v2]")
    said = capsys.readouterr().out
    assert f"note: {SHOWN}" in said
    assert f"failed: {SHOWN}" in said
    assert len(said) < 20_000


ODD = ("[red]a\tb\x1b[1m", "final [v2]", ":bomb:")
"""Names of folders that are words of a markup too."""


def show_path(path: Path) -> str:
    return f"written to {path}".replace("\t", " ").replace("\x1b", r"\x1b")


def test_the_printed_path_is_shown_as_it_is(
    tmp_path: Path, small_result: Result, capsys: pytest.CaptureFixture[str]
) -> None:
    for output in ODD:
        print_table(small_result, tmp_path / output)
        assert capsys.readouterr().out.splitlines()[-1] == show_path(tmp_path / output)


@pytest.mark.slow
@pytest.mark.parametrize("output", ODD)
def test_the_printed_path_is_that_of_the_folder(output: str, small_done: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-c", "from damageest.cli import main; main()", "run", "job.yaml", "-o", output],
        cwd=small_done.parent, capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert (small_done.parent / output / "result.json").is_file()
    assert ran.stdout.splitlines()[-1] == show_path((small_done.parent / output).resolve())
