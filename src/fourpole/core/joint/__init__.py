"""The joint route: all tests of a rig at once, with estimates of its values and of the channels' gains besides K*.

``identify_joint`` is the entry. ``shared`` has the values that all tests share, ``conditions`` groups tests of the same
tyre in the same state, ``model`` gives the phasors and their derivatives, ``solve`` finds the most probable values,
``misfit`` tests whether the stated rig agrees with the tests, and ``reconcile`` applies remedies where it does not.
"""

from __future__ import annotations

from fourpole.core.joint.identify import identify_joint
from fourpole.core.joint.joint import Joint, solve_joint

__all__ = ["Joint", "identify_joint", "solve_joint"]
