"""A hook of MkDocs: executes the notebooks of this folder and puts them into the site as pages with their outputs.

The notebooks are committed without outputs. One whose cell fails ends the build. DAMAGEEST_NOTEBOOKS=no leaves the
execution out, for work on other pages; `mkdocs serve` executes a notebook again only where it was changed.
"""

from __future__ import annotations

import logging
import os
import re
from pathlib import Path
from typing import Any

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient

SECONDS = 600
"""Most that a cell may take."""
HERE = Path(__file__).parent
_kept: dict[str, str] = {}
"""Pages by the text of their notebooks."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds a page for each notebook."""
    for path in sorted(HERE.glob("*.ipynb")):
        text = path.read_text(encoding="utf-8")
        if text not in _kept:
            _kept[text] = make_page(text)
        name = f"notebooks/{path.stem}.md"
        files.append(File.generated(config, name, content=f"{_kept[text]}\n[The notebook]({path.name})\n"))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """Links of other pages to a notebook lead to its page; on GitHub they lead to the notebook itself."""
    return re.sub(r"\(notebooks/(\w+)\.ipynb\)", r"(notebooks/\1.md)", markdown)


def make_page(text: str) -> str:
    """The Markdown of a notebook, executed: its text, its code, and what each cell gave."""
    notebook: Any = nbformat.reads(text, as_version=4)
    if os.environ.get("DAMAGEEST_NOTEBOOKS") != "no":
        logging.getLogger("mkdocs").info("executing %s", notebook.cells[0].source.splitlines()[0])
        NotebookClient(notebook, timeout=SECONDS, resources={"metadata": {"path": str(HERE)}}).execute()
    parts = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            # another notebook is a page here; its file beside it is what GitHub shows
            parts.append(re.sub(r"\((\w+)\.ipynb\)", r"(\1.md)", cell.source))
        else:
            parts += [f"```python\n{cell.source}\n```", *map(show, cell.get("outputs", ()))]
    return "\n\n".join(filter(None, parts)) + "\n"


def show(output: Any) -> str:
    """An output as Markdown: HTML and drawings as they are, text in a block. What a library warns of is left out."""
    if output.output_type == "stream":
        return "" if output.name == "stderr" else _quote(output.text)
    data = output.get("data", {})
    for kind in ("text/html", "image/svg+xml"):
        if kind in data:
            joined = re.sub(r"\n\s*", " ", data[kind])  # an empty line would end the block
            return f'<div class="output">{joined}</div>'
    return _quote(data.get("text/plain", ""))


def _quote(text: str) -> str:
    return f"```text\n{text.rstrip()}\n```" if text.strip() else ""
