"""The joint route: one estimate of K*, the rig's values and the channels' gains from all tests of a rig.

The entry is ``identify_joint``. The modules are:

- ``joint``: the wiring of the solution, from first values of K* in closed form;
- ``shared``: the values that all tests share;
- ``conditions``: groups of tests of the same condition;
- ``model``: the phasors and their derivatives;
- ``solve``: the most probable values;
- ``misfit``: residuals, and candidates for the cause of a misfit, small or gross;
- ``scatter``: K* of single tests about that of their condition;
- ``specimens``: outliers, scatter and drift of K*; problem, solution and misfit between two remedies;
- ``reconcile``: the remedies if the stated rig does not agree with the tests;
- ``outputs``: K*, K2, C and TR of each test, with their derivatives; the entry, with the result type of every route.
"""

from __future__ import annotations

from fourpole.core.joint.joint import Joint, solve_joint
from fourpole.core.joint.outputs import identify_joint

__all__ = ["Joint", "identify_joint", "solve_joint"]
