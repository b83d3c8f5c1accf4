"""The four poles in UFF 58, read back by the columns of the published layout."""

import numpy as np
import pytest
from tests.belted_rig import BeltedRig
from tests.export.test_uff import data_sets, function

from fourpole.campaign.row import Test as Row
from fourpole.core.allpoles import all_poles
from fourpole.export.uff import write_two_ports
from fourpole.study.twoports import TwoPort

FREQUENCIES = np.array([10.0, 30.0, 50.0, 90.0])


@pytest.mark.parametrize("count", [4, 1])
def test_each_pole_is_a_force_over_a_displacement_of_two_nodes(tmp_path, count):
    poles = all_poles(*BeltedRig().recorded(FREQUENCIES[:count], noise=1e-4))
    found = TwoPort(Row("D1", 2), "car, 2.2 bar", poles, poles, 0.0, None)
    write_two_ports([found, found], "Belts", tmp_path / "twoport.uff")
    sets = data_sets((tmp_path / "twoport.uff").read_text("ascii"))
    assert [number for number, _ in sets] == [151, 164, *[58] * 8]
    read = [function(lines) for number, lines in sets if number == 58]
    assert [one["number"] for one in read] == list(range(1, 9))
    for at, one in enumerate(read):
        row, column = divmod(at % 4, 2)
        assert one["type"] == 4
        assert one["response"][1:] == (row + 1, 3)
        assert one["reference"][1:] == (column + 1, 3)
        assert one["id"][0].startswith(f"Dynamic stiffness k{row + 1}{column + 1}")
        assert one["id"][1:3] == ["car, 2.2 bar", "k12 and k21 differ: not reciprocal"]
        assert "standard uncertainty up to" in one["id"][4]
        assert [axis[0] for axis in one["axes"][:3]] == [18, 13, 8]
        np.testing.assert_allclose(one["x"], FREQUENCIES[:count], rtol=1e-5)
        np.testing.assert_allclose(one["y"], poles.stiffness[:, row, column], rtol=1e-10)
