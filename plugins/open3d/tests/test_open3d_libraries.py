"""What open3d says where a system library is missing; these tests run without it too."""

from __future__ import annotations

import subprocess
import sys

import damageest_open3d
import pytest
from damageest_open3d import _system

from damageest.errors import PluginError
from damageest.registry import Registry


def test_a_missing_system_library_leaves_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    load = _system.load

    def without(library: str) -> None:
        if library in ("libEGL.so.1", "libGL.so.1"):
            raise OSError(f"{library}: cannot open shared object file")
        load(library)

    monkeypatch.setattr(_system, "load", without)
    with pytest.raises(PluginError, match=r"libEGL\.so\.1, libGL\.so\.1") as caught:
        damageest_open3d.damageest_stages()
    assert "apt-get install libegl1 libgl1" in caught.value.remedy
    registry = Registry.discover()
    assert [b.remedy for b in registry.broken if b.provider.name == "damageest-open3d"] == [caught.value.remedy]
    assert any(item.name == "pyvista" for item in registry.of("reconstruct"))
    with pytest.raises(KeyError, match="apt-get install libegl1"):
        registry.get("reconstruct", "ball_pivot")


def test_libusb_comes_from_its_package_where_the_system_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def bare(library: str) -> None:
        asked.append(library)
        if library == "libusb-1.0.so.0":
            raise OSError

    monkeypatch.setattr(_system, "load", bare)
    _system.check()
    assert asked[-1].endswith("libusb-1.0.so")
    monkeypatch.setattr(_system, "_bundled_usb", lambda: "libusb-1.0.so.0")
    with pytest.raises(PluginError, match="libusb") as caught:
        _system.check()
    assert "libusb-package" in caught.value.remedy


def test_the_stages_are_listed_without_importing_open3d() -> None:
    code = (
        "import sys, damageest_open3d as d\n"
        "from damageest.errors import PluginError\n"
        "try: d.damageest_stages()\n"
        "except PluginError: pass\n"
        "sys.exit('open3d' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
