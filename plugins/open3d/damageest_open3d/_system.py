"""The shared libraries that Open3D expects from the system, and the one of them that a Python package brings."""

from __future__ import annotations

from damageest.errors import PluginError
from damageest.registry.system_libraries import can_load, load, require

__all__ = ["PACKAGES", "check", "load"]

PACKAGES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libudev.so.1": "libudev1",
    "libidn2.so.0": "libidn2-0",
}
"""Each library and the Debian or Ubuntu package that has it."""


def check() -> None:
    """Loads what Open3D needs, without Open3D itself: some milliseconds instead of seconds.

    Raises PluginError that names what is missing and how to install it.
    """
    require("Open3D", PACKAGES, load)
    # The dynamic linker finds a loaded library by its name, in whatever folder it lies.
    if not can_load("libusb-1.0.so.0", load) and not can_load(_bundled_usb(), load):
        raise PluginError(
            "Open3D needs libusb-1.0.so.0, which neither the system nor the package libusb-package has here",
            "pip install libusb-package, or apt-get install libusb-1.0-0",
        )


def _bundled_usb() -> str:
    from importlib.util import find_spec
    from pathlib import Path

    spec = find_spec("libusb_package")
    folder = Path(spec.origin).parent if spec and spec.origin else Path()
    return str(next(iter(sorted(folder.glob("libusb-1.0*.so*"))), folder / "libusb-1.0.so"))
