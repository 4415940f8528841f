"""What the program says to people: plain phrases, short sentences, options and fields that have a noun."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted(
    [
        *(ROOT / "damageest").rglob("*.py"),
        *ROOT.glob("plugins/*/damageest_*/**/*.py"),
        *ROOT.glob("benchmarks/damageest_*/**/*.py"),
    ]
)
pytestmark = pytest.mark.slow  # all sources are parsed
BANNED = [
    r"\b(is|are|was|were) asked\b",
    r"\b(is|are|was|were) told\b(?! apart)",
    r"\bin words\b",
    r"\bwhat is left\b",
    r"\bmay err\b",
    r"\bcondemn",
    r"\btaken for\b",
    r"\bin no interval\b",
    r"\b(is|are|was|were) to be (like|had)\b",
    r"\bwhat it (is|does|has) (measured|asked|told)\b",
]
"""Clauses in place of a noun."""
LONGEST = 45
"""Words of a sentence at most; those that list values apart, a person reads no longer one."""
MEAN = 12
"""Words of a sentence on average at most."""


def join(node: ast.AST) -> str | None:
    """The text of a literal, with {} for what is put in; None for another node."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(one.value if isinstance(one, ast.Constant) else "{}" for one in node.values)  # type: ignore[misc]
    return None


def walk(node: ast.AST) -> Iterator[str]:
    """The literals below a node, docstrings apart."""
    text = join(node)
    if text is not None:
        yield " ".join(text.split())
    elif not (isinstance(node, ast.Expr) and join(node.value) is not None):
        for child in ast.iter_child_nodes(node):
            yield from walk(child)


def list_texts() -> Iterator[tuple[str, str]]:
    """Literals of four words or more, each with its file."""
    for path in SOURCES:
        for text in walk(ast.parse(path.read_text())):
            if len(re.findall(r"[A-Za-z]{2,}", text)) >= 4 and " " in text and "<" not in text:
                yield str(path.relative_to(ROOT)), text


@cache
def read_texts() -> list[tuple[str, str]]:
    """All of them, read once."""
    return list(list_texts())


@pytest.mark.parametrize("phrase", BANNED)
def test_no_text_has_a_clause_in_place_of_a_noun(phrase: str) -> None:
    assert not [(path, text) for path, text in read_texts() if re.search(phrase, text)]


def test_sentences_are_short() -> None:
    sentences = [
        (path, sentence)
        for path, text in read_texts()
        for sentence in re.split(r"(?<=[.;:?!])\s+", text)
        if len(sentence.split()) > 1
    ]
    assert len(sentences) > 3000
    assert sum(len(sentence.split()) for _, sentence in sentences) / len(sentences) <= MEAN
    assert not [(path, one) for path, one in sentences if len(one.split()) > LONGEST]


def test_a_description_of_an_option_or_a_field_has_a_noun_of_its_own() -> None:
    """Not "of the tool", which only the name of the option completes."""
    found = []
    for path in SOURCES:
        for call in (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)):
            if isinstance(call.func, ast.Name) and call.func.id == "Field":
                texts = [join(word.value) or "" for word in call.keywords if word.arg == "description"]
                found += [
                    (path.name, text)
                    for text in texts
                    if re.match(r"(of|the same (as|by|after)|about|how|as|so) ", text)
                ]
    assert not found
