"""The shared libraries that Open3D expects from the system, and the one of them that a Python package brings."""

from __future__ import annotations

import ctypes

from damageest.errors import PluginError

PACKAGES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libudev.so.1": "libudev1",
    "libidn2.so.0": "libidn2-0",
}
"""Each library and the Debian or Ubuntu package that has it."""


def load(library: str) -> None:
    """Loads a shared library into the process, for others to find. Raises OSError where it is not there."""
    ctypes.CDLL(library)


def check() -> None:
    """Loads what Open3D needs, without Open3D itself: some milliseconds instead of seconds.

    Raises PluginError that names what is missing and how to install it.
    """
    missing = [library for library in PACKAGES if not _loads(library)]
    if missing:
        raise PluginError(
            f"Open3D needs {', '.join(missing)} from the system, and does not find it here",
            f"apt-get install {' '.join(PACKAGES[library] for library in missing)}, "
            "or the packages that have these files on this system",
        )
    # By its name the dynamic linker takes it for the one Open3D asks for, wherever it was loaded from.
    if not _loads("libusb-1.0.so.0") and not _loads(_bundled_usb()):
        raise PluginError(
            "Open3D needs libusb-1.0.so.0, which neither the system nor the package libusb-package has here",
            "pip install libusb-package, or apt-get install libusb-1.0-0",
        )


def _loads(library: str) -> bool:
    try:
        load(library)
    except OSError:
        return False
    return True


def _bundled_usb() -> str:
    from importlib.util import find_spec
    from pathlib import Path

    spec = find_spec("libusb_package")
    folder = Path(spec.origin).parent if spec and spec.origin else Path()
    return str(next(iter(sorted(folder.glob("libusb-1.0*.so*"))), folder / "libusb-1.0.so"))
