"""The cache of compiled functions: one folder for each state of the code compiled together.

Numba's own cache checks the file of a function alone, and serves stale code after an edit of a
function that it calls in another file.  Here every edit of any such file leads to a new folder.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numba
import numba.core.config

_PACKAGE = Path(__file__).parent


def sources() -> list[Path]:
    """Source files of compiled functions: all kernels (leading underscore) and the lanes."""
    kernels = [path for path in _PACKAGE.glob("*/_*.py") if path.name != "__init__.py"]
    return sorted([*kernels, _PACKAGE / "mechanics" / "lanes.py"])


def fingerprint(files: list[Path]) -> str:
    """First 16 hexadecimal digits of a SHA-256 over the names and bytes of files."""
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.name.encode() + b"\n" + path.read_bytes() + b"\n")
    return digest.hexdigest()[:16]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def folder() -> Path:
    """Folder of the compiled functions of this code, created if missing.

    It lies in ``NUMBA_CACHE_DIR`` if that is set, else in the user's cache, else in the folder for
    temporary files: the first that can be written.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    temporary = Path(tempfile.gettempdir()) / f"maglev-{os.getuid()}"
    bases = [*([Path(given)] if given else []), Path(user) / "maglev", temporary]
    name = fingerprint(sources())
    for base in bases:
        if _writable(base / name):
            return base / name
    raise RuntimeError(
        f"no folder for compiled functions can be written, tried {', '.join(map(str, bases))}; "
        "set NUMBA_CACHE_DIR to one"
    )


numba.core.config.CACHE_DIR = str(folder())

kernel: Callable[..., Any] = partial(numba.njit, cache=True, error_model="numpy")
"""Compile and cache a function; a division by zero gives infinity or NaN and raises nothing."""
