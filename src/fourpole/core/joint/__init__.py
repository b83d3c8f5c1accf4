"""The joint route: one estimate of K*, the rig's values and the channels' gains from all tests of a rig.

The entry is ``identify_joint``. The modules are:

- ``shared``: the values that all tests share;
- ``conditions``: groups of tests of the same condition;
- ``model``: the phasors and their derivatives;
- ``solve``: the most probable values;
- ``misfit``: the test whether the stated rig agrees with the tests;
- ``reconcile``: the remedies if it does not agree.
"""

from __future__ import annotations

from fourpole.core.joint.identify import identify_joint
from fourpole.core.joint.joint import Joint, solve_joint

__all__ = ["Joint", "identify_joint", "solve_joint"]
