"""The tour of the code shows lines that are there, in the functions that it names."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "docs/tour.md").read_text()
STOPS = [part for part in TEXT.split("\n## ") if re.match(r"\d", part)]


def find_source(path: Path, name: str) -> str:
    """The source of a function, or of a method as ``Class.method``."""
    text = path.read_text()
    body: list[ast.stmt] = ast.parse(text).body
    node: ast.stmt | None = None
    for word in name.split("."):
        node = next(one for one in body if getattr(one, "name", None) == word)
        body = getattr(node, "body", [])
    assert node is not None
    return ast.get_source_segment(text, node) or ""


def test_there_are_ten_stops() -> None:
    assert len(STOPS) == 10


@pytest.mark.parametrize("stop", STOPS, ids=lambda text: text.splitlines()[0])
def test_each_line_is_in_its_function(stop: str) -> None:
    path, name = re.findall(r"^`(damageest/[\w/]+\.py)`, `([\w.]+)`", stop, re.MULTILINE)[0]
    lines = re.findall(r"```python\n(.*?)```", stop, re.DOTALL)
    assert lines
    assert lines[0].strip() in find_source(ROOT / path, name)
    named = [one for one in re.findall(r"`((?:\w+/)+\w+\.py)`", stop) if not one.startswith("damageest/")]
    others = [(ROOT / "damageest" / one).read_text() for one in named]  # each is there
    for line in lines[1:]:
        assert any(line.strip() in text for text in others)


def test_each_folder_and_file_that_it_names_is_there() -> None:
    for name in re.findall(r"`([\w/]+/[\w/]*(?:\.py)?)`", TEXT):
        assert (ROOT / name).exists() or (ROOT / "damageest" / name).exists(), name


def test_the_job_is_the_example() -> None:
    (job,) = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)
    assert (ROOT / "jobs/block_wedge.yaml").read_text().endswith(job)
