"""Files written whole or not at all, and the provenance that goes into them."""

from __future__ import annotations

import os
from collections.abc import Callable
from os import PathLike
from typing import Any


def write(path: str | PathLike[str], fill: Callable[[str], object]) -> None:
    """Let `fill` write a temporary file beside `path`, then move it into place; on failure nothing is left behind.

    Raises
    ------
    OSError
        With the path and the reason if it cannot be written.
    """
    import tempfile

    target = os.path.abspath(os.fspath(path))
    folder, name = os.path.split(target)
    stem, ending = os.path.splitext(name)
    if os.path.isdir(target):
        raise IsADirectoryError(f"output path is {os.fspath(path)!r}: a file name is needed, this is a folder.")
    try:
        handle, draft = tempfile.mkstemp(prefix=f".{stem}-", suffix=ending, dir=folder)
    except OSError as error:
        reason = error.strerror or str(error)
        raise type(error)(f"output path is {os.fspath(path)!r}: a writable place is needed ({reason}).") from None
    os.close(handle)
    try:
        fill(draft)
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(draft, 0o666 & ~umask)
        os.replace(draft, target)
    except BaseException:
        os.unlink(draft)
        raise


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write `text` in UTF-8, whole or not at all."""

    def fill(draft: str) -> None:
        with open(draft, "w", encoding="utf-8") as file:
            file.write(text)

    write(path, fill)


def provenance() -> dict[str, Any]:
    """Versions and platform, so that a number can be traced."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    def known(package: str) -> str | None:
        try:
            return version(package)
        except PackageNotFoundError:
            return None

    packages = {name: known(name) for name in ("granular", "numpy", "scipy", "numba", "sortedcontainers")}
    return {"versions": packages, "python": platform.python_version(), "machine": platform.machine()}
