"""Fingerprints of code, which ignore docstrings, and of files."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).parent
_NAME = _PACKAGE.name


def _file(module: str) -> Path | None:
    """File of a module of the package; None if there is no such module."""
    stem = _PACKAGE.joinpath(*module.split(".")[1:])
    for path in (stem.with_suffix(".py"), stem / "__init__.py"):
        if path.is_file():
            return path
    return None


@cache
def _read(text: str) -> tuple[tuple[str, ...], str]:
    """Imported names of a module, and its syntax tree without docstrings as text."""
    tree = ast.parse(text)
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return tuple(names), ast.dump(_without_docstrings(tree))


def _imports(module: str) -> Iterator[str]:
    """Modules of the package that a module imports, anywhere in its code."""
    path = _file(module)
    if path is None:
        raise ValueError(f"there is no module {module}")
    names, _ = _read(path.read_text(encoding="utf-8"))
    yield from (n for n in names if n.split(".")[0] == _NAME and _file(n) is not None)


def standing_on(*modules: str, without: Sequence[str] = ()) -> tuple[str, ...]:
    """Return modules and all modules of the package that they import, sorted by name.

    Parameters
    ----------
    modules
        Dotted names inside the package, such as ``"stages.passage"``.
    without
        Modules to leave out, with what only they import.

    Raises
    ------
    ValueError
        If there is no such module.

    Examples
    --------
    >>> standing_on("compiled")
    ('maglev.compiled',)
    """
    open_names = [f"{_NAME}.{module}" for module in modules]
    left_out = {f"{_NAME}.{module}" for module in without}
    found: set[str] = set()
    while open_names:
        name = open_names.pop()
        if name not in found and name not in left_out:
            found.add(name)
            open_names.extend(_imports(name))
    return tuple(sorted(found))


def _without_docstrings(tree: ast.Module) -> ast.Module:
    for node in ast.walk(tree):
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        first = node.body[0] if node.body else None
        if (
            isinstance(first, ast.Expr)
            and isinstance(first.value, ast.Constant)
            and isinstance(first.value.value, str)
        ):
            node.body = node.body[1:]
    return tree


def code_of(*modules: str, without: Sequence[str] = ()) -> str:
    """Hash of the syntax trees of modules and of all modules of the package that they import.

    Parameters
    ----------
    modules
        Dotted names inside the package, such as ``"stages.passage"``.
    without
        Modules to leave out, with what only they import.

    Returns
    -------
    fingerprint
        First 16 hexadecimal digits of a SHA-256 over the syntax trees without docstrings.

    Raises
    ------
    ValueError
        If there is no such module.

    Examples
    --------
    >>> len(code_of("compiled"))
    16
    """
    digest = hashlib.sha256()
    for name in standing_on(*modules, without=without):
        path = _file(name)
        assert path is not None  # standing_on has found it
        _, tree = _read(path.read_text(encoding="utf-8"))
        digest.update(f"{name}\n{tree}\n".encode())
    return digest.hexdigest()[:16]


def file_hash(path: str | Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "empty"
    ...     path.touch()
    ...     file_hash(path)[:8]
    'e3b0c442'
    """
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
