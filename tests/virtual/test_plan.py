"""The plan of a campaign: which tests, under which names, in which order."""

import pytest

from fourpole.virtual import CROSS_PLY, RADIAL_PLY, RUBBER_MOUNT
from fourpole.virtual.plan import plan_tests

CONDITIONS = ([CROSS_PLY, RADIAL_PLY], [100e3, 170e3], [1000.0, 2000.0], [10.0, 24.0])


def of_kind(tests, kind):
    return [test for test in tests if test.kind == kind]


def test_every_condition_is_run_once():
    tests = plan_tests(*CONDITIONS, added_masses=[0.0, 10.0], calibration_masses=[5.0])
    assert [len(of_kind(tests, kind)) for kind in ("static", "dynamic", "calibration")] == [4, 32, 2]
    assert len({test.name for test in tests}) == len(set(tests)) == 38
    assert all(test.name.startswith(test.kind[0].upper()) for test in tests)


def test_added_mass_may_be_tested_at_one_condition_only():
    tests = plan_tests(*CONDITIONS, added_masses=[0.0, 10.0], added_mass_at=("radial-ply", 170e3, 2000.0))
    assert len(of_kind(tests, "dynamic")) == 16 + 2
    heavy = [test for test in tests if test.added_mass]
    assert [(test.mounted.name, test.pressure, test.preload) for test in heavy] == [("radial-ply", 170e3, 2000.0)] * 2
    assert [test.frequency for test in heavy] == [10.0, 24.0]


def test_mounts_come_last_and_change_no_test_of_the_tyres():
    tests, without = (plan_tests(*CONDITIONS, mounts=mounts) for mounts in ([RUBBER_MOUNT], []))
    assert [test for test in tests if test.mounted is not RUBBER_MOUNT] == without
    of_mount = [(test.name, test.preload, test.frequency) for test in tests if test.mounted is RUBBER_MOUNT]
    assert [name for name, *_ in of_mount] == ["S5", "D17", "D18"]
    assert [numbers for _, *numbers in of_mount[1:]] == [[1000.0, 10.0], [1000.0, 24.0]]
    assert all(test.pressure != test.pressure for test in tests if test.mounted is RUBBER_MOUNT)


def test_calibration_has_a_mass_and_no_tyre():
    blocks = of_kind(plan_tests(*CONDITIONS, calibration_masses=[5.0, 10.0]), "calibration")
    assert [(test.added_mass, test.frequency) for test in blocks] == [
        (5.0, 10.0),
        (5.0, 24.0),
        (10.0, 10.0),
        (10.0, 24.0),
    ]
    with pytest.raises(ValueError, match="test C1 is a calibration"):
        _ = blocks[0].mounted


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"added_mass_at": ("bias-ply", 170e3, 1000.0)}, "is no condition"),
        ({"added_mass_at": ("radial-ply", 1.7, 1000.0)}, "is no condition"),
        ({"calibration_masses": [0.0]}, "must be > 0 kg"),
    ],
)
def test_impossible_plans_are_refused(options, said):
    with pytest.raises(ValueError, match=said):
        plan_tests(*CONDITIONS, **options)
