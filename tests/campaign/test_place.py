"""Where a file of a campaign is: decided by its name first, before anything is looked up."""

import os
import sys

import pytest

from fourpole.app.standing import identities
from fourpole.campaign.place import at_hand, identity_or_none, inside
from fourpole.errors import FileError

pytestmark = pytest.mark.thorough

BY_TEXT = {
    "\\\\host\\share\\D1.csv": "names another machine",
    "//host/share/D1.csv": "names another machine",
    "\\/host/share/D1.csv": "names another machine",
    "/\\host\\share\\D1.csv": "names another machine",
    "\\\\?\\C:\\D1.csv": "names another machine",
    "\\\\.\\pipe\\D1": "names another machine",
    "file:////host/share/D1.csv": "names another machine",
    "file://localhost//host/share/D1.csv": "names another machine",
    "file:///%5C%5Chost/share/D1.csv": "names another machine",
    "C:\\data\\D1.csv": "is on another drive",
    "c:/data/D1.csv": "is on another drive",
    "file:///C:/data/D1.csv": "is on another drive",
    "D1\0.csv": "has a character that no name of a file may have",
    "D1\ud800.csv": "has a character that no name of a file may have",
    "CON": "is the name of a device on Windows",
    "recordings/nul.csv": "is the name of a device on Windows",
    "recordings/Aux.tar.gz": "is the name of a device on Windows",
    "recordings/nul:": "is the name of a device on Windows",
    "COM1": "is the name of a device on Windows",
    "recordings/lpt9 .csv": "is the name of a device on Windows",
    "nul#run": "is the name of a device on Windows",
    "con/D1.csv": "is the name of a device on Windows",
}


@pytest.fixture
def looked_up(monkeypatch):
    """Names that the system is asked about."""
    names = []
    for function in ("stat", "lstat", "open", "readlink", "scandir"):
        true = getattr(os, function)

        def asked(name, *more, _true=true, **told):
            names.append(name)
            return _true(name, *more, **told)

        monkeypatch.setattr(os, function, asked)
    return names


@pytest.mark.parametrize("name", BY_TEXT)
def test_a_name_that_leads_elsewhere_is_refused_before_anything_is_looked_up(tmp_path, looked_up, name):
    with pytest.raises(FileError, match=BY_TEXT[name]):
        inside(tmp_path, name)
    assert identity_or_none(tmp_path, name) is None
    with pytest.raises(FileError), at_hand(tmp_path, name):
        pass
    assert "drive" in BY_TEXT[name] or identities(tmp_path, [name]) == {name: None}
    assert looked_up == []


@pytest.mark.parametrize(
    "name", ["D1.csv", "console.csv", "nullpoint/D1.csv", "a:b.csv", "D1#con.csv", "COM10.csv", "ä µ.csv"]
)
@pytest.mark.skipif(sys.platform == "win32", reason="some of these names are none there")
def test_a_name_that_is_like_these_is_that_of_a_file(tmp_path, name):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("t,F1\n")
    assert inside(tmp_path, name) == path.resolve()
    with at_hand(tmp_path, name) as found:
        assert found.read_text() == "t,F1\n"


@pytest.mark.parametrize("way", ["D1.csv", "within/D1.csv", "../outside/D1.csv"])
def test_a_link_out_of_the_folder_is_refused_wherever_it_is(tmp_path, way):
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "D1.csv").write_text("t,F1\n")
    folder = tmp_path / "campaign"
    folder.mkdir()
    (folder / "D1.csv").symlink_to(tmp_path / "outside" / "D1.csv")
    (folder / "within").symlink_to(tmp_path / "outside")
    with pytest.raises(FileError, match="lies outside the campaign folder: copy it into the folder"):
        inside(folder, way)


def test_a_link_within_the_folder_is_followed(tmp_path):
    (tmp_path / "a.csv").write_text("t,F1\n")
    (tmp_path / "b.csv").symlink_to("a.csv")
    with at_hand(tmp_path, "b.csv") as path:
        assert path.read_text() == "t,F1\n"


def test_a_file_that_is_exchanged_while_it_is_read_is_refused(tmp_path):
    (tmp_path / "D1.csv").write_text("t,F1\n")
    (tmp_path / "new.csv").write_text("t,F1\n")
    with (
        pytest.raises(FileError, match=r"D1\.csv: was replaced while it was read: run it again"),
        at_hand(tmp_path, "D1.csv") as path,
    ):
        (tmp_path / "new.csv").replace(path)


def test_a_file_to_which_more_is_written_is_the_same_file(tmp_path):
    (tmp_path / "D1.csv").write_text("t,F1\n")
    with at_hand(tmp_path, "D1.csv") as path, path.open("a") as file:
        file.write("0,1\n")
