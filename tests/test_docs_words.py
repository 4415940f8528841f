"""The documentation stays within its limits of words, and the count cannot be fooled."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


def load_counter() -> ModuleType:
    spec = importlib.util.spec_from_file_location("words", ROOT / "docs" / "words.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


WORDS = load_counter()


def test_no_page_and_not_all_of_them_have_more_words_than_they_may() -> None:
    pages = dict(WORDS.list_pages())
    assert {"README.md", "ARCHITECTURE.md", "docs/index.md", "docs/notebooks/sweep.ipynb"} <= set(pages)
    assert WORDS.find_faults(pages) == [], "shorten, or leave out what another page says: python docs/words.py"


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("Two words.\n", 2),
        ("# A head\n\n| a | 1.5 |\n| --- | --- |\n", 4),
        ("See [this page](some-page.md#with-anchor).\n", 3),
        ("Run\n\n```sh\ndamageest run job.yaml\n```\n\nnow.\n", 2),
        ("<!-- a remark -->\none `option`\n", 2),
        ("one\n<!-- suite: begin -->\nmany words\n<!-- suite: end -->\ntwo\n", 2),
        ("<!-- Generated; do not edit. -->\n\nmany words\n", 0),
        ("::: damageest.artefacts\n    options:\n      members: false\nafter\n", 1),
    ],
)
def test_words_are_those_that_somebody_wrote(text: str, count: int) -> None:
    assert WORDS.count_words(text) == count


def test_what_is_too_long_is_named() -> None:
    pages = {"README.md": WORDS.README + 1, "docs/a.md": WORDS.PAGE + 1, "docs/b.md": WORDS.TOTAL}
    named = [fault.split(":")[0] for fault in WORDS.find_faults(pages)]
    assert set(named) == {"README.md", "docs/a.md", "docs/b.md", "all pages"}


def test_the_changelog_says_in_few_lines_what_the_first_release_does() -> None:
    lines = WORDS.count_release((ROOT / "CHANGELOG.md").read_text())
    assert 0 < lines <= WORDS.CHANGELOG
