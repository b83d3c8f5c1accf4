"""Planning: the expected uncertainty of planned tests, and the cheapest changes that reach a wanted uncertainty.

``expect`` gives the result that the analysis would state for tests as planned. ``remedies`` lists possible changes of a
plan with their cost. ``advise`` finds the cheapest changes that are sufficient.
"""

from __future__ import annotations

from fourpole.core.plan.advice import Advice, Outcome, advise
from fourpole.core.plan.expect import PLAN_ROUTES, PlannedTests, expect, possible_routes
from fourpole.core.plan.remedies import MASSES, Effort, Plan, Remedy

__all__ = [
    "MASSES",
    "PLAN_ROUTES",
    "Advice",
    "Effort",
    "Outcome",
    "Plan",
    "PlannedTests",
    "Remedy",
    "advise",
    "expect",
    "possible_routes",
]
