"""Remarks of many tests: one line for each kind, with the number of tests and the first names."""

from fourpole.app.alike import gathered_alike

OFF = "the recording turns at {} Hz, {} Hz is stated: correct the frequency"


def test_remarks_of_one_kind_are_one():
    remarks = [(f"D{i}", "off", OFF.format(10 + 1e-3 * i, 12)) for i in range(14)] + [("D99", "file", "no such file")]
    many, alone = gathered_alike(remarks)
    assert many.tests == "14 tests (D0, D1, D2, D3, D4, D5 and 8 more)"
    assert many.text == f"{remarks[0][2]} (this is D0)"
    assert (alone.tests, alone.text) == ("D99", "no such file")


def test_equal_remarks_name_no_test_of_the_numbers():
    (both,) = gathered_alike([("D1", 0, "clipped at 5 V"), ("D2", 0, "clipped at 5 V")])
    assert both.text == "clipped at 5 V"


def test_another_kind_is_another_remark():
    assert len(gathered_alike([("D1", "V2", "V2 is clipped"), ("D2", "V1", "V1 is clipped")])) == 2
