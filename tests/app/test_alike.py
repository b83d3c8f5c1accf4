"""Remarks of many tests: one line for each kind, with the number of tests and the first names."""

from fourpole.app.alike import gathered_alike

OFF = "the recording turns at {} Hz, {} Hz is stated: correct the frequency"


def test_remarks_that_differ_in_numbers_are_one():
    remarks = [(f"D{i}", OFF.format(10 + 1e-3 * i, 12)) for i in range(14)] + [("D99", "no such file")]
    many, one = gathered_alike(remarks)
    assert many.tests == "14 tests (D0, D1, D2, D3, D4, D5 and 8 more)"
    assert many.text == f"{remarks[0][1]} (this is D0)"
    assert (one.tests, one.text) == ("D99", "no such file")


def test_equal_remarks_name_no_test_of_the_numbers():
    (both,) = gathered_alike([("D1", "clipped at 5 V"), ("D2", "clipped at 5 V")])
    assert both.text == "clipped at 5 V"


def test_the_file_of_each_test_is_no_difference():
    (one,) = gathered_alike([(f"X{i}", f"recordings/X{i}.csv: there is no such file") for i in range(3)])
    assert one.tests == "3 tests (X0, X1, X2)"


def test_another_channel_is_another_remark():
    assert len(gathered_alike([("D1", "V2 is clipped"), ("D2", "V1 is clipped")])) == 2
