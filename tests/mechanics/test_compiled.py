"""Where compiled functions are kept: an edit of any file of kernels leads to another folder."""

import shutil

import pytest

from maglev import compiled

KERNELS = ("lanes.py", "_rows.py", "_magnets.py", "_kernels.py", "_records.py")


@pytest.fixture
def copied(tmp_path, monkeypatch):
    """A copy of the package's files that the folder is named after."""
    package = tmp_path / "maglev"
    for path in compiled.sources():
        target = package / path.relative_to(compiled._PACKAGE)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    monkeypatch.setattr(compiled, "_PACKAGE", package)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    return package


@pytest.mark.parametrize("name", KERNELS)
def test_an_edit_of_a_file_of_kernels_changes_the_folder_and_undoing_it_brings_it_back(
    copied, name
):
    before = compiled.folder()
    path = copied / "mechanics" / name
    text = path.read_text()
    path.write_text(text + "\n")
    after = compiled.folder()
    assert after != before
    path.write_text(text)
    assert compiled.folder() == before
    assert {before.parent, after.parent} == {copied.parent / "cache"}


def test_a_new_file_of_kernels_changes_the_folder(copied):
    before = compiled.folder()
    (copied / "mechanics" / "_more.py").write_text("")
    assert compiled.folder() != before


def test_every_compiled_function_stands_in_a_file_that_the_folder_is_named_after():
    package = compiled._PACKAGE
    compiling = {
        path for path in package.rglob("*.py")
        if "njit" in path.read_text() or "@kernel(" in path.read_text()
    }  # fmt: skip
    assert compiling - {package / "compiled.py"} <= set(compiled.sources())


def test_a_folder_that_cannot_be_written_gives_way_to_the_next(copied, monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(blocked))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert compiled.folder().parent == tmp_path / "home" / "maglev"
