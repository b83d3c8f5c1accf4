"""Before testing: the uncertainty to expect of a plan, and what reaches a wanted one at least effort.

``expect`` says what the analysis would state of tests that went as planned; ``remedies`` lists what can be done about
it, and what each costs; ``advise`` finds the cheapest that do.
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
