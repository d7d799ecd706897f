"""The fingerprint of code: edits change it, comments and docstrings do not."""

import pytest

from maglev import fingerprint


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of two modules, the first importing the second inside a function."""
    root = tmp_path / "maglev"
    root.mkdir()
    (root / "a.py").write_text("def f():\n    from maglev.b import g\n    return g()\n")
    (root / "b.py").write_text('"""What b is."""\n\ndef g():\n    return 1\n')
    (root / "c.py").write_text("x = 1\n")
    monkeypatch.setattr(fingerprint, "_PACKAGE", root)
    return root


def test_it_covers_what_is_imported_and_nothing_else(package):
    assert fingerprint.standing_on("a") == ("maglev.a", "maglev.b")


def test_an_edit_changes_it_even_in_an_imported_module(package):
    before = fingerprint.code_of("a")
    (package / "b.py").write_text('"""What b is."""\n\ndef g():\n    return 2\n')
    assert fingerprint.code_of("a") != before


def test_comments_docstrings_and_other_modules_do_not_change_it(package):
    before = fingerprint.code_of("a")
    (package / "b.py").write_text(
        '"""Another."""\n\ndef g():  # one\n    """One."""\n    return 1\n'
    )
    (package / "c.py").write_text("x = 2\n")
    assert fingerprint.code_of("a") == before


def test_an_unknown_module_is_refused(package):
    with pytest.raises(ValueError, match=r"there is no module maglev\.nowhere"):
        fingerprint.code_of("nowhere")


def test_a_module_left_out_takes_with_it_what_only_it_imports():
    whole, part = (
        fingerprint.standing_on("simulation"),
        fingerprint.standing_on("simulation", without=["datasets"]),
    )
    assert {"maglev.datasets", "maglev.mechanics._kernels"} <= set(whole)
    assert "maglev.datasets" not in part and "maglev.mechanics._kernels" in part
    assert fingerprint.code_of("simulation") != fingerprint.code_of(
        "simulation", without=["datasets"]
    )
