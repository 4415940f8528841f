"""A hook of MkDocs: pages that are generated stand below those that people wrote, where both answer a search."""

from __future__ import annotations

from typing import Any

BELOW = ("api/", "stages/", "job-reference.md", "contracts.md", "result.md", "changelog.md", "decisions.md", "tour.md")
BOOST = 0.02


def on_page_markdown(markdown: str, page: Any, **_: object) -> str:
    if page.file.src_uri.startswith(BELOW):
        page.meta.setdefault("search", {"boost": BOOST})
    return markdown
