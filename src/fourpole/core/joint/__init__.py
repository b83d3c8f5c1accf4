"""The joint route: all tests of a rig at once, its values and the channels' gains found along with K*.

``identify_joint`` is the face; ``shared`` says what the tests have in common, ``conditions`` which tests see the same
tyre, ``model`` what the phasors should be and how they change, ``solve`` finds the most probable values, ``misfit``
asks whether the rig as stated can be true.
"""

from __future__ import annotations

from fourpole.core.joint.identify import identify_joint
from fourpole.core.joint.joint import Joint, solve_joint

__all__ = ["Joint", "identify_joint", "solve_joint"]
