"""What pymeshlab says where a system library is missing; these tests run without it too."""

from __future__ import annotations

import subprocess
import sys

import damageest_pymeshlab
import pytest
from damageest_pymeshlab import _system

from damageest.errors import PluginError
from damageest.registry import Registry


def test_a_missing_system_library_leaves_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    load = _system.load

    def without(library: str) -> None:
        if library == "libGL.so.1":
            raise OSError(f"{library}: cannot open shared object file")
        load(library)

    monkeypatch.setattr(_system, "load", without)
    with pytest.raises(PluginError, match=r"libGL\.so\.1") as caught:
        damageest_pymeshlab.damageest_stages()
    assert "apt-get install libgl1" in caught.value.remedy
    registry = Registry.discover()
    assert [b.remedy for b in registry.broken if b.provider.name == "damageest-pymeshlab"] == [caught.value.remedy]
    with pytest.raises(KeyError, match="apt-get install libgl1"):
        registry.get("boolean", "pymeshlab")
    assert registry.get("boolean", "manifold")


def test_the_stages_are_listed_without_importing_pymeshlab() -> None:
    code = (
        "import sys, damageest_pymeshlab as d\n"
        "from damageest.errors import PluginError\n"
        "try: d.damageest_stages()\n"
        "except PluginError: pass\n"
        "sys.exit('pymeshlab' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
