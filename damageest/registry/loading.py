"""Loads the built-ins and the installed plugins; a plugin that fails to import is kept with its error."""

from __future__ import annotations

import hashlib
import importlib.util
import traceback
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points, version
from pathlib import Path
from typing import Any

import pluggy

from damageest.errors import (
    PluginError,
    clean_message,
    describe_install,
    describe_pip_install,
    find_missing_library,
    is_interrupt,
)
from damageest.isolation import at_work
from damageest.registry import bundled, hookspecs

GROUP = "damageest"
OWN = "damageest"
"""The distribution of the built-ins."""


@dataclass(frozen=True)
class Provider:
    """A distribution that provides stages: its ``name``, ``version``, ``licence`` and the ``module`` of its hooks."""

    name: str
    version: str
    licence: str
    module: str

    def __str__(self) -> str:
        return f"{self.name} {self.version}"

    @cached_property
    def fingerprint(self) -> str:
        """Digest over version and source: results of an earlier version of the code are not used."""
        digest = hashlib.sha256(str(self).encode())
        spec = importlib.util.find_spec(self.module.split(".")[0])
        for place in (spec.submodule_search_locations or [spec.origin or ""]) if spec else []:
            root = Path(str(place))
            for path in sorted(root.rglob("*.py")) if root.is_dir() else [root]:
                digest.update(path.name.encode() + path.read_bytes())
        return digest.hexdigest()


@dataclass(frozen=True)
class Broken:
    """A plugin, or one implementation of it, that cannot be used: why, and what to do."""

    provider: Provider
    reason: str
    remedy: str


def load(observers: Iterable[object] = ()) -> tuple[pluggy.PluginManager, list[tuple[Any, Provider]], list[Broken]]:
    """The hooks, the plugins that loaded (built-ins first) and those that did not."""
    manager = pluggy.PluginManager(GROUP)
    manager.add_hookspecs(hookspecs)
    loaded: list[tuple[Any, Provider]] = []
    broken: list[Broken] = []
    own = EntryPoint("builtins", "damageest.registry.builtins", GROUP)
    for point, provider in [(own, _describe_own()), *_list_installed()]:
        try:
            with ignore_shadow_warnings(), at_work(f"the import of {provider}", owner=f"{provider}"):
                plugin = point.load()
            manager.register(plugin, f"{provider.name}:{point.name}")
        except BaseException as error:
            broken.append(describe_broken(error, provider))
        else:
            loaded.append((plugin, provider))
    for observer in observers:
        manager.register(observer)
    return manager, loaded, broken


@contextmanager
def ignore_shadow_warnings() -> Iterator[None]:
    """Hides pydantic's warning on options that shadow an attribute: the registry refuses them with its own message."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Field name .* shadows an attribute", category=UserWarning)
        yield


def _describe_own() -> Provider:
    return Provider(OWN, version(OWN), "Apache-2.0", "damageest.registry.builtins")


@dataclass(frozen=True)
class _Faulty:
    """Stands in for an entry point that cannot be read. Loading it says why."""

    name: str
    error: PluginError

    def load(self) -> Any:
        raise self.error


def _list_installed() -> list[tuple[EntryPoint | _Faulty, Provider]]:
    """The entry points of all distributions. Where the metadata of one is damaged, as after an installation that was
    interrupted, it alone is left out, or broken where it names damageest."""
    found: list[tuple[EntryPoint | _Faulty, Provider]]
    try:
        found = [(point, _describe_provider(point)) for point in entry_points(group=GROUP)]
    except Exception:  # of any package, also one that has nothing to do with damageest
        found = [pair for dist in _list_distributions() for pair in _read_distribution(dist)]
    return sorted(found, key=lambda pair: (pair[1].name, pair[0].name))


def _list_distributions() -> list[Distribution]:
    """All of them, those that come first on the path before others of their name."""
    named = {_name_distribution(dist): dist for dist in reversed(list(distributions()))}
    return list(named.values())


def _read_distribution(dist: Distribution) -> list[tuple[EntryPoint | _Faulty, Provider]]:
    try:
        points = [point for point in dist.entry_points if point.group == GROUP]
    except Exception as error:
        names_us = f"[{GROUP}]" in _read_text(dist, "entry_points.txt")
        return [_describe_faulty(dist, "its entry points", error)] if names_us else []
    found: list[tuple[EntryPoint | _Faulty, Provider]] = []
    for point in points:
        try:
            found.append((point, _describe_provider(point)))
        except AttributeError:
            wrong = ValueError("it is no module, nor module:object")
            found.append(_describe_faulty(dist, f"its entry point '{point.name} = {point.value}'", wrong))
        except Exception as error:
            found.append(_describe_faulty(dist, f"its entry point '{point.name} = {point.value}'", error))
    return found


def _describe_faulty(dist: Distribution, what: str, error: Exception) -> tuple[_Faulty, Provider]:
    name = _name_distribution(dist)
    place = f", in {dist.locate_file('')}" if _read_text(dist, "entry_points.txt") else ""
    fault = PluginError(
        f"{what} cannot be read ({type(error).__name__}: {clean_message(error, 200)}){place}",
        f"install {name} again, or delete its folder",
    )
    return _Faulty(what, fault), Provider(name, "?", "?", "")


def _name_distribution(dist: Distribution) -> str:
    """Its name; of one without metadata, that of its folder."""
    try:
        name = dist.metadata["Name"]
    except Exception:
        name = None
    folder = Path(str(getattr(dist, "_path", "unknown"))).stem
    return str(name) if name else folder.rpartition("-")[0] or folder


def _read_text(dist: Distribution, name: str) -> str:
    """A file of its metadata, as far as it can be read."""
    path = Path(str(getattr(dist, "_path", ""))) / name
    return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""


def _describe_provider(point: EntryPoint) -> Provider:
    """Raises an exception of any kind where its metadata is damaged."""
    dist = point.dist
    if dist is None:
        return Provider(point.name, "?", "?", point.module)
    meta = dist.metadata
    licence = next((meta[key] for key in ("License-Expression", "License") if key in meta), "not stated")
    return Provider(
        str(dist.name or _name_distribution(dist)), str(dist.version or "?"), licence.splitlines()[0], point.module
    )


def describe_broken(error: BaseException, provider: Provider) -> Broken:
    """The plugin as broken by an error, with what to do about it. Raises KeyboardInterrupt for an interrupt."""
    if is_interrupt(error):
        raise KeyboardInterrupt from error
    kind = "" if type(error) is PluginError else f"{type(error).__name__}: "
    text = f"{kind}{clean_message(error)}{_locate(error, provider)}"
    return Broken(provider, text, clean_message(_suggest_remedy(error, provider)))


def _locate(error: BaseException, provider: Provider) -> str:
    """Where in the plugin's own files an error arose; nothing for one that its author wrote for the user."""
    root = provider.module.split(".")[0]
    own = [f for f in traceback.extract_tb(error.__traceback__) if root in Path(f.filename).with_suffix("").parts]
    return f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own and type(error) is not PluginError else ""


def _suggest_remedy(error: BaseException, provider: Provider) -> str:
    if isinstance(error, PluginError) and error.remedy:
        return error.remedy
    if isinstance(error, ModuleNotFoundError) and error.name:
        if provider.name in bundled.PACKAGES:
            return describe_install(provider.name)
        return f"{describe_pip_install(error.name)}, or reinstall {provider.name}"
    if library := find_missing_library(error):
        return f"install the system package that has {library}"
    return f"update or uninstall {provider.name}"
