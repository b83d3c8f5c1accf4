"""The table with which an analysis ends: within 80 columns and 25 lines, no number cut, ranges of many conditions."""

import pytest

from fourpole import analyse
from fourpole.app.summary import summary_lines
from fourpole.virtual import simulate_campaign

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def lines_of(tmp_path_factory):
    def of(**stated):
        folder = tmp_path_factory.mktemp("campaign") / "c"
        simulate_campaign(folder, frequencies=[14.0], **stated)
        return summary_lines(analyse(folder).results)

    return of


@pytest.mark.parametrize("pressures", [[170e3], [130e3, 170e3, 210e3], [130e3 + 10e3 * n for n in range(9)]])
def test_the_table_fits_a_terminal(lines_of, pressures):
    lines = lines_of(pressures=pressures, preloads=[1000.0])
    assert len(lines) <= 22
    assert max(map(len, lines)) <= 80
    ranges = 2 * len(pressures) > 12
    about = ", lowest to highest of all conditions" if ranges else "; ± is U (k = 2)"
    assert lines[0] == f"At 14 Hz{about}:"
    conditions = [line for line in lines if line.startswith(" ") and "[" not in line]
    assert len(conditions) % (2 if ranges else 2 * len(pressures)) == 0
    for line in conditions:
        assert "…" not in line
        assert ("±" in line) == (not ranges)
    heads = " ".join(line for line in lines if "[" in line)
    assert [part in heads for part in ("K1 [kN/m]", "|K*| [kN/m]", "δ [°]", "K2 [kN/m]", "C [N s/m]")] == [True] * 5
