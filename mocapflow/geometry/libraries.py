"""A library that is loaded where it is used."""

from __future__ import annotations

from types import ModuleType

from mocapflow.errors import MocapflowError


def load_open3d(where: str = "") -> ModuleType:
    """Return the package open3d, which is slow to import and asks for libraries of the system.

    Args:
        where: what it is needed for, a file.

    Raises:
        MocapflowError: one of them is not there.
    """
    try:
        import open3d
    except (ImportError, OSError) as error:
        hint = "it needs libusb-1.0 and libGL (Debian, Ubuntu: apt install libusb-1.0-0 libgl1 libgomp1)"
        raise MocapflowError(f"Open3D can't be loaded: {error}", where=where, hint=hint) from error
    return open3d
