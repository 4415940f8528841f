"""Conversions of a result that plugins add: found, called, named where there is none; faults named."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

import damageest
from damageest.errors import InputError, StageError
from damageest.registry import Registry
from tests.registry.test_registry import Site, site  # noqa: F401 - a fixture

COUNTED = """
def count(result, what, site):
    return len(result.mesh(what, site).faces)

@hookimpl
def damageest_conversions():
    return {NAME: count}
"""


@pytest.mark.slow
def test_a_plugins_conversion_is_called_with_the_result(site: Site, tiny_done: Path) -> None:  # noqa: F811
    site.add("acme-count", COUNTED.replace("NAME", "'count'"))
    result = damageest.run(tiny_done, output=True)
    assert result.convert("count", "damage", 1) == len(result.sites[0].damage.faces)
    with pytest.raises(InputError, match=r"no plugin here converts a result to 'cont'; there are: .*\bcount\b"):
        result.convert("cont", "damage", 1)


def test_without_the_package_it_is_named_and_the_result_can_be_pickled(
    tiny_done: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("damageest.registry.loading._list_installed", list)
    result = pickle.loads(pickle.dumps(damageest.run(tiny_done, output=True)))
    with pytest.raises(InputError, match="'cadquery' needs the plugin damageest-cadquery, which is not installed"):
        result.as_cadquery("damage", 1)


def test_a_kind_that_is_there_already_and_what_is_no_function_are_faults(site: Site) -> None:  # noqa: F811
    site.add("acme-a", COUNTED.replace("NAME", "'count'"))
    site.add("acme-again", COUNTED.replace("NAME", "'count'"))
    site.add("acme-wrong", "@hookimpl\ndef damageest_conversions():\n    return {'x': 3}\n")
    registry = Registry.discover()
    broken = {item.provider.name: item.reason for item in registry.broken}
    assert "converts to count, as another package does already" in broken["acme-again"]
    assert "did not give a mapping of names to functions" in broken["acme-wrong"]
    assert "x" not in registry.conversions


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return result.volumes", "(acme_count.count) failed: AttributeError: 'NoneType' object has no attribute"),
        ("import acme_kernel", "(acme_count.count): the Python module acme_kernel is not installed"),
        ("raise SystemExit(3)", "(acme_count.count) failed: SystemExit: 3"),
    ],
)
def test_a_faulty_conversion_is_named_with_its_package_and_function(
    site: Site,  # noqa: F811
    body: str,
    message: str,
) -> None:
    source = COUNTED.replace("NAME", "'count'").replace("return len(result.mesh(what, site).faces)", body)
    site.add("acme-count", source)
    with pytest.raises(StageError) as caught:
        Registry.discover().conversions["count"](None, "damage", 1)
    assert f"the conversion 'count' of acme-count 1.2 {message}" in caught.value.message
