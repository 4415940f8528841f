"""What a test needs from this machine: where a plugin or a terminal cannot be used, its tests are skipped, with the
reason.

For a plugin only a system library that is missing counts as a reason. A plugin that is broken in another way fails its
tests.
"""

from __future__ import annotations

import importlib
import os
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from damageest.errors import PluginError

PLUGINS = tuple(sorted(path.parent.name for path in (Path(__file__).parents[1] / "plugins").glob("*/pyproject.toml")))
"""The short names of this repository's plugins: their folders."""


@cache
def find_obstacle(plugin: str) -> str:
    """Which system library the plugin lacks here, and what to do; empty where it can be used."""
    try:
        module = importlib.import_module(f"damageest_{plugin}")
        if hasattr(module, "damageest_stages"):
            module.damageest_stages()
    except PluginError as error:
        return f"{error}; {error.remedy}"
    return ""


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
