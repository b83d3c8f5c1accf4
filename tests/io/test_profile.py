"""Road profiles: tables of distance and height, and OpenCRG where its reader is installed."""

import sys

import numpy as np
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io.tables.pair import read_profile


def test_distance_and_height_are_known_by_their_names_and_units(tmp_path):
    path = tmp_path / "road.csv"
    path.write_text("s [km];elevation [mm]\n0;0\n0,001;1,5\n0,002;\n")
    found = read_profile(path)
    assert found.distance == pytest.approx([0.0, 1.0, 2.0])
    assert found.height[:2] == pytest.approx([0.0, 0.0015])
    assert np.isnan(found.height[2])
    assert "distance along the road: column 's' [km]" in found.understood


@pytest.mark.parametrize(
    ("head", "words"), [("a,b", "distance"), ("distance [m],b", "height"), ("distance [s],z [m]", "distance")]
)
def test_a_table_without_them_is_refused(tmp_path, head, words):
    path = tmp_path / "road.csv"
    path.write_text(f"{head}\n0,0\n1,1\n")
    with pytest.raises(TableError, match=f"no column is understood as the {words}"):
        read_profile(path)


def test_a_road_of_opencrg_names_its_reader_where_that_is_missing(tmp_path, monkeypatch):
    path = tmp_path / "road.crg"
    path.write_text("$CT\n$\n")
    monkeypatch.setitem(sys.modules, "pyopencrg", None)
    with pytest.raises(FileError, match="pip install PyOpenCRG, or write the road as a table"):
        read_profile(path)
    with pytest.raises(FileError, match="there is no such file"):
        read_profile(tmp_path / "no.crg")


def test_a_road_of_opencrg_is_its_reference_line(tmp_path):
    crg = pytest.importorskip("pyopencrg")
    across = np.linspace(-1.0, 1.0, 4)  # the reference line lies between two lines of the grid
    height = 0.01 * np.sin(0.1 * np.arange(500))[:, None] + 0.002 * across
    road = crg.CrgRoad(height, u_inc=0.05, v=across)
    road.save(str(tmp_path / "road.crg"))
    found = read_profile(tmp_path / "road.crg")
    assert found.distance == pytest.approx(0.05 * np.arange(500), abs=1e-6)
    assert found.height == pytest.approx(0.01 * np.sin(0.1 * np.arange(500)), abs=1e-6)
    height[100] = np.nan
    crg.CrgRoad(height, u_inc=0.05, v=across).save(str(tmp_path / "hole.crg"))
    assert np.isnan(read_profile(tmp_path / "hole.crg").height).sum() == 1
    (tmp_path / "half.crg").write_bytes((tmp_path / "road.crg").read_bytes()[:-3990])
    with pytest.raises(TableError, match=r"is damaged .*: copy or export it again"):
        read_profile(tmp_path / "half.crg")
    (tmp_path / "half.crg").write_bytes((tmp_path / "road.crg").read_bytes()[:-4000])
    (said, *_) = read_profile(tmp_path / "half.crg").warnings
    assert said.startswith("half.crg: ")
    assert "500 cross sections but the file has" in said
    (tmp_path / "none.crg").write_text("no road")
    with pytest.raises(TableError, match="is no road of OpenCRG that can be read"):
        read_profile(tmp_path / "none.crg")
