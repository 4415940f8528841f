"""A table that is a room: the classes of one kind in its files."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from inspect import isabstract
from pkgutil import iter_modules
from typing import TypeVar

T = TypeVar("T")


def find_classes(package: str, folders: Iterable[str], base: type[T]) -> list[type[T]]:
    """The classes derived from ``base`` that the modules of a package define, but for abstract ones."""
    modules = [import_module(f"{package}.{found.name}") for found in iter_modules(folders)]
    return [
        one
        for module in modules
        for one in vars(module).values()
        if isinstance(one, type)
        and issubclass(one, base)
        and one.__module__ == module.__name__
        and not isabstract(one)
        and not one.__name__.startswith("_")
    ]
