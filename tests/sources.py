"""The source files of the package, of its plugins and benchmarks, and what they import."""

from __future__ import annotations

import ast
import re
import textwrap
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLUGIN_SOURCES = sorted((ROOT / "plugins").glob("*/damageest_*/**/*.py"))
BENCHMARKS = sorted((ROOT / "benchmarks" / "damageest_benchmarks").rglob("*.py"))
SOURCES = sorted([*(ROOT / "damageest").rglob("*.py"), *PLUGIN_SOURCES, *BENCHMARKS])
STATEMENT = re.compile(r"^[ \t]*(?:from[ \t]+\S+[ \t]+import\b[ \t]*(?:\([^)]*\)|.*)|import[ \t]+\w.*)", re.MULTILINE)
"""A statement that imports. Formatted sources have one statement a line, so that files need not be parsed as a whole,
which takes seconds for all of them."""


def find_imports(source: str) -> list[tuple[str, str]]:
    """The modules and names that a source text imports, with those inside functions and in lines of its texts.

    A name is empty for `import module`.
    """
    found = []
    for match in STATEMENT.finditer(source):
        try:
            found += parse_imports(textwrap.dedent(match[0]))
        except SyntaxError:  # words of a docstring
            continue
    return found


def parse_imports(source: str) -> list[tuple[str, str]]:
    """As `find_imports`, without those in texts. It takes long for a whole file."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            assert not node.level, "a relative import"
            found += [(node.module or "", alias.name) for alias in node.names]
        elif isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
    return found


@cache
def list_imports(path: Path) -> list[tuple[str, str]]:
    """As `find_imports`, of a file."""
    return find_imports(path.read_text(encoding="utf-8"))


def list_imported(path: Path) -> list[str]:
    """Every module that a file imports, and every name in full, as if it were a module."""
    return [full for module, name in list_imports(path) for full in (module, *([f"{module}.{name}"] if name else ()))]
