"""Marks of elements, by which tests and scripts find them: the words on the page may change."""

from __future__ import annotations


def mark(name: str, *more: str) -> list[str]:
    """Attributes that are written as they are: the mark, and ``more`` of them."""
    return [f'data-test="{name}"', *more]
