"""What a test needs from this machine: where a plugin or a terminal cannot be used, its tests are skipped, with the
reason.

For a plugin a system library or a package that is missing counts as a reason. A plugin that is broken in another way
fails its tests.
"""

from __future__ import annotations

import importlib
import os
from functools import cache
from importlib.util import find_spec
from typing import Any

import pytest

from damageest.errors import PluginError, describe_missing_library, find_missing_library
from tests.optional_imports import PROJECTS, list_optional, list_required

PLUGINS = tuple(name for name in PROJECTS if name != "benchmarks")
"""The short names of this repository's plugins: their folders."""


@cache
def find_obstacle(plugin: str) -> str:
    """Which system library or package the plugin lacks here, and what to do; empty where it can be used. Packages are
    looked for, not imported: that would take seconds."""
    if missing := next((module for module in list_required(plugin) if find_spec(module) is None), ""):
        return _say_missing(missing)
    try:
        module = importlib.import_module(f"damageest_{plugin}")
        if hasattr(module, "damageest_stages"):
            module.damageest_stages()
    except PluginError as error:
        return f"{error}; {error.remedy}"
    except ImportError as error:
        if said := explain_import_error(error):
            return said
        raise
    return ""


@cache
def find_unusable(plugin: str) -> str:
    """As `find_obstacle`, but imports the packages that the plugin requires: one may be there and not load. Empty where
    one is broken in another way."""
    try:
        if obstacle := find_obstacle(plugin):
            return obstacle
        for module in list_required(plugin):
            importlib.import_module(module)
    except ImportError as error:
        said = explain_import_error(error)
        return f"the plugin {plugin} cannot be used here: {said}" if said else ""
    return ""


def import_or_skip(module: str) -> Any:
    """A module of a package that few tests need. Skips the test, or the file at whose top it is called, where the
    package is not there or lacks a system library; `pytest.importorskip` would raise for the second."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        if not (reason := explain_import_error(error)):
            raise
    pytest.skip(reason, allow_module_level=True)


def explain_import_error(error: ImportError) -> str:
    """What is missing, and what to install; empty where nothing is: the module is broken, or not there though it is of
    this repository."""
    if isinstance(error, ModuleNotFoundError) and error.name and not error.name.startswith(("damageest", "tests")):
        return _say_missing(error.name.partition(".")[0])
    if find_missing_library(error) and (described := describe_missing_library(error)):
        return f"{described.message}; {described.own_remedy}"
    return ""


def _say_missing(module: str) -> str:
    package = next((name for name, modules in list_optional().items() if module in modules), module)
    return f"the Python module {module} is not installed; pip install {package}"


def needs_plugin(*plugins: str) -> pytest.MarkDecorator:
    """Skips a test, or with ``pytestmark`` a file of tests, where one of the plugins cannot be used."""
    obstacles = [find_obstacle(plugin) for plugin in plugins]
    return pytest.mark.skipif(any(obstacles), reason="; ".join(filter(None, obstacles)))


@cache
def find_terminal_obstacle() -> str:
    """Why no terminal can be opened here; empty where one can."""
    try:
        for end in os.openpty():
            os.close(end)
    except OSError as error:
        return f"no terminal can be opened here ({error}): mount /dev/pts (devpts)"
    return ""


def needs_terminal() -> pytest.MarkDecorator:
    """Skips a test where no terminal can be opened, as in containers without /dev/pts."""
    obstacle = find_terminal_obstacle()
    return pytest.mark.skipif(bool(obstacle), reason=obstacle)


def import_for(plugin: str, module: str) -> Any:
    """A module that needs what the plugin needs; None where the plugin cannot be used, so that its tests, which
    `needs_plugin` skips, are still counted."""
    return None if find_obstacle(plugin) else importlib.import_module(module)
