"""Numbers that decide what a plan expects of a test: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

import pytest

from fourpole.core.condition import AXES
from fourpole.planning.expected import _distance
from fourpole.planning.plan import Run

#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "temperature as far as a factor of e, 50 K": (
        lambda x: _distance(AXES[2], 20.0, 20.0 + x) > _distance(AXES[0], 1e5, 2.718282e5), {49.5: False, 50.5: True},
    ),
    "cycles to which a noise refers, 40": (lambda n: Run(1e-4, n).noise_of_test > 1e-4, {39.6: True, 40.4: False}),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
