"""Counts the words that people write by hand in the documentation, page by page, and holds them to limits.

    python docs/words.py

Not counted: code blocks, comments, addresses of links, generated pages (``<!-- Generated``) and generated sections,
which stand between ``<!-- NAME: begin -->`` and ``<!-- NAME: end -->``.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TOTAL = 30_000
"""Most words in all pages."""
PAGE = 2_000
"""Most words on one page."""
README = 900
CHANGELOG = 60
"""Most lines of the first release in CHANGELOG.md."""
GENERATED = "<!-- Generated"
APART = [
    re.compile(r"^(`{3,})\w*\n.*?^\1$", re.DOTALL | re.MULTILINE),  # code
    re.compile(r"<!-- (\w+): begin -->.*?<!-- \1: end -->", re.DOTALL),
    re.compile(r"<!--.*?-->", re.DOTALL),
    re.compile(r"(?<=\])\([^)\s]*\)"),  # addresses of links and pictures
    re.compile(r"^:::.*\n(?:    .*\n)*", re.MULTILINE),  # what mkdocstrings puts there
]


def count_words(text: str) -> int:
    """Words of a page of Markdown that somebody wrote: what has a letter or a digit."""
    if text.startswith(GENERATED):
        return 0
    for pattern in APART:
        text = pattern.sub(" ", text)
    return sum(any(sign.isalnum() for sign in word) for word in text.split())


def read_notebook(path: Path) -> str:
    """The text of a notebook, without its code."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return "\n\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")


def list_pages() -> Iterator[tuple[str, int]]:
    """Each page, and its words."""
    for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"):
        yield name, count_words((ROOT / name).read_text(encoding="utf-8"))
    for folder in ("docs", "benchmarks"):
        for path in sorted((ROOT / folder).rglob("*.md")):
            yield str(path.relative_to(ROOT)), count_words(path.read_text(encoding="utf-8"))
    for path in sorted((ROOT / "docs/notebooks").glob("*.ipynb")):
        yield str(path.relative_to(ROOT)), count_words(read_notebook(path))


def count_release(text: str) -> int:
    """Lines of the first release in the changelog, empty ones apart."""
    section = text.partition("\n## 1.0.0rc1")[2].partition("\n## ")[0]
    return sum(bool(line.strip()) for line in section.splitlines()[1:])


def find_faults(pages: dict[str, int]) -> list[str]:
    """What is above a limit."""
    faults = [f"{name}: {words} words, {PAGE} at most" for name, words in pages.items() if words > PAGE]
    if pages["README.md"] > README:
        faults.append(f"README.md: {pages['README.md']} words, {README} at most")
    if sum(pages.values()) > TOTAL:
        faults.append(f"all pages: {sum(pages.values())} words, {TOTAL} at most")
    return faults


def main() -> int:
    pages = dict(list_pages())
    for name, words in pages.items():
        print(f"{words:7,d}  {name}")
    print(f"{sum(pages.values()):7,d}  in all")
    faults = find_faults(pages)
    for fault in faults:
        print(f"too long: {fault}")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
