"""docs/scan-to-program.md shows what its job gives."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import damageest

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "scan-to-program.md"
SHOWN = 20
"""Lines of each program on the page."""
PROGRAMS = {"kuka": ("krl", "src"), "sinumerik_table_table": ("sinumerik", "mpf")}


def read_blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE.read_text(), re.DOTALL | re.MULTILINE)


def test_the_page_shows_the_job() -> None:
    (job,) = read_blocks("yaml")
    text = (ROOT / "jobs" / "block_kuka.yaml").read_text()
    assert job == text[text.index("version:") :]


@pytest.mark.slow  # 20 s of the processor; pytest -m slow plugins/machines/tests/test_machines_page.py
def test_the_page_shows_the_first_lines_of_its_programs(tmp_path: Path) -> None:
    """The job is run for one machine; for the other only the export is new."""
    found = []
    for machine, (form, suffix) in PROGRAMS.items():
        settings = [f"export.machine={machine}", f"export.paths={form}"]
        damageest.run(ROOT / "jobs" / "block_kuka.yaml", output=tmp_path / "out", settings=settings)
        lines = (tmp_path / "out" / "path" / f"site-1.{suffix}").read_text().splitlines()
        found.append("\n".join(lines[:SHOWN]) + "\n")
    assert read_blocks("text") == found
