"""The joint route: one estimate of K*, the rig's values and the channels' gains from all tests of a rig.

The entry is ``identify_joint``. The modules are:

- ``identify``: the entry, with the result type of every route;
- ``joint``: the wiring of the solution;
- ``shared``: the values that all tests share;
- ``conditions``: groups of tests of the same condition;
- ``model``: the phasors and their derivatives;
- ``start``: first values of K* in closed form;
- ``gross``: units, signs and exchanged columns that no small change of a value explains;
- ``solve``: the most probable values;
- ``misfit``: residuals, and candidates for the cause of a misfit;
- ``scatter``: K* of single tests about that of their condition;
- ``specimens``: outliers, scatter and drift of K*;
- ``reconcile``: the remedies if the stated rig does not agree with the tests;
- ``state``: problem, solution and misfit between two remedies;
- ``outputs``: K*, K2, C and TR of each test, with their derivatives.
"""

from __future__ import annotations

from fourpole.core.joint.identify import identify_joint
from fourpole.core.joint.joint import Joint, solve_joint

__all__ = ["Joint", "identify_joint", "solve_joint"]
