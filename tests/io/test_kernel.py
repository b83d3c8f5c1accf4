"""Which library does the work, and who says so."""

import pytest

from fourpole.core import kernel
from fourpole.errors import FourpoleError
from fourpole.io.kernel import VARIABLE, filled_by, filling, library, said


@pytest.fixture
def none_built(monkeypatch, tmp_path):
    monkeypatch.setattr("fourpole.io.kernel.place", lambda: str(tmp_path / "no.so"))


@pytest.mark.usefixtures("none_built")
def test_without_a_library_numpy_does_it(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert library() is None
    assert filling() == "numpy"
    assert said().endswith("(kernel: numpy)")


@pytest.mark.usefixtures("none_built")
def test_what_is_wanted_must_be_there(monkeypatch):
    monkeypatch.setenv(VARIABLE, "c")
    with pytest.raises(FourpoleError, match="run make kernel, or unset the variable"):
        library()
    assert "run make kernel" in said()


def test_what_is_wanted_must_be_known(monkeypatch):
    monkeypatch.setenv(VARIABLE, "C")
    with pytest.raises(FourpoleError, match="FOURPOLE_KERNEL is 'C': write c or numpy"):
        filling()


def test_a_library_that_is_none_is_left(monkeypatch, tmp_path):
    (tmp_path / "kernel.so").write_bytes(b"\x7fELF no library")
    monkeypatch.setattr("fourpole.io.kernel.place", lambda: str(tmp_path / "kernel.so"))
    monkeypatch.delenv(VARIABLE, raising=False)
    assert filling() == "numpy"


def test_the_choice_lasts_as_long_as_its_context(monkeypatch):
    monkeypatch.setenv(VARIABLE, "numpy")
    with filled_by("c"), filled_by("numpy"), filled_by("else"):
        assert kernel.library() is None
    with filled_by(""):
        assert filling() == "numpy"


@pytest.mark.usefixtures("library")
def test_the_library_is_taken_where_it_is_built(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert filling() == "c"
    assert said().endswith("(kernel: c)")
