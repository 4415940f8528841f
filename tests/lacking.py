"""A plugin of pytest: the tests of a plugin of ours are skipped where a package that it requires does not load."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path

import pytest

from tests.needs import PLUGINS, find_unusable

PLUGIN_TESTS = {Path(__file__).parents[1] / "plugins" / plugin / "tests": plugin for plugin in PLUGINS}


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A plugin's test that fails on such a machine is skipped, with the reason. The packages are tried after a failure
    only: to import all of them takes seconds."""
    report = yield
    plugin = PLUGIN_TESTS.get(item.path.parent)
    if report.failed and plugin and (reason := find_unusable(plugin)):
        report.outcome = "skipped"
        report.longrepr = (str(item.path), 0, f"Skipped: {reason}")
    return report
