"""A plugin of pytest: a test that cannot run since a package is missing here, or does not load, is skipped."""

from __future__ import annotations

import traceback
from collections.abc import Generator
from pathlib import Path

import pytest

from tests.needs import explain_import_error, find_unusable, import_or_skip
from tests.optional_imports import PROJECTS, ROOT

PLUGIN_TESTS = {folder / "tests": plugin for plugin, folder in PROJECTS.items()}


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "needs(module, ...): skipped where one of the modules cannot be imported")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Imports what the mark `needs` names, before fixtures do: of a test whose product code needs a package."""
    for mark in item.iter_markers("needs"):
        for module in mark.args:
            import_or_skip(module)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Looks at a test that failed only: to try all packages before takes seconds."""
    report = yield
    if report.failed and call.excinfo is not None and (reason := _find_reason(item.path, call.excinfo.value)):
        report.outcome = "skipped"
        report.longrepr = (str(item.path), 0, f"Skipped: {reason}")
    return report


def _find_reason(path: Path, error: BaseException) -> str:
    """Which package is missing that the test itself imports, or that the plugin requires whose test it is. Empty where
    code of the product raises ImportError: it has to say what is missing."""
    if isinstance(error, ImportError) and _is_of_tests(error):
        return explain_import_error(error)
    plugin = PLUGIN_TESTS.get(path.parent)
    return find_unusable(plugin) if plugin else ""


def _is_of_tests(error: ImportError) -> bool:
    """Whether the last statement of this repository that led to the error stands in a file of tests."""
    files = [Path(frame.filename) for frame in traceback.extract_tb(error.__traceback__)]
    own = [file.relative_to(ROOT).parts for file in files if file.is_relative_to(ROOT)]
    own = [parts for parts in own if parts[0] in ("damageest", "tests", "plugins", "benchmarks")]
    return bool(own) and "tests" in own[-1]
