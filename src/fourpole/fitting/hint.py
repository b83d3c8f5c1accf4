"""What one error of V1's channel would explain: K* of all conditions that no passive linear tyre can have as it is.

With one mass an error of V1 acts in every test as another tyre would, so the joint route cannot see it. The models can,
if they are right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fourpole.core.joint.around import Likelihood
from fourpole.core.joint.shared import SharedParameter
from fourpole.core.joint.solve import solve
from fourpole.core.sources import Kind, Source
from fourpole.fitting.mapping import common_likelihood
from fourpole.fitting.measured import Measured
from fourpole.models.causality import check_possible
from fourpole.models.ladder import Verdict

#: Errors that are tried: the logarithm of a gain, or the phase [rad] by a delay at the highest frequency; and their
#: standard uncertainty then, which leaves the error to the tests.
_TRIED = (0.0, 0.06, -0.06, 0.12, -0.12, 0.18, -0.18, 0.24, -0.24)
_WIDE = 0.05
#: The same for an error that is one value for all conditions, as a share of the value.
_ONE_VALUE = 0.05


def channel_hint(measured: Sequence[Measured], verdicts: Sequence[Verdict]) -> str:
    """An error of V1's gain or delay with which all conditions are possible, as a sentence; empty if there is none.

    It is looked for if some condition is impossible and all conditions are from one rig with one mass.
    """
    likelihood = None if all(one.possible for one in verdicts) else common_likelihood(measured)
    if likelihood is None or likelihood.problem.shared.masses.size:
        return ""
    for kind in (Kind.GAIN, Kind.DELAY):
        value = _common_error(measured, likelihood, Source(kind, "V1"))
        if value is not None:
            size = f"{100 * np.expm1(value):+.2g} %" if kind is Kind.GAIN else f"{1e6 * value:+.0f} µs"
            return (
                f"hint: K* of all conditions would be possible with an error of {size} of the {kind.text.strip()} of "
                "V1. One mass cannot show it: weigh a mass and add it, or calibrate V1"
            )
    return ""


def _common_error(measured: Sequence[Measured], likelihood: Likelihood, source: Source) -> float | None:
    """The error, in its unit, with which every condition is possible; None if there is no such error."""
    if source not in likelihood.problem.errors:
        return None
    unit = 1.0 if source.kind is Kind.GAIN else 1.0 / float(likelihood.problem.observed.omega.max())
    for tried in _TRIED:
        near = _without_error(likelihood, source, tried * unit, _WIDE * unit)
        found = [tried * unit + moved for one in measured if (moved := _error_of(one, near)) is not None]
        if len(found) == len(measured):
            value = float(np.median(found))
            single = _without_error(likelihood, source, value, _ONE_VALUE * abs(value))
            return value if all(_error_of(one, single) is not None for one in measured) else None
    return None


def _error_of(one: Measured, likelihood: Likelihood) -> float | None:
    """The last of the shared values with which a passive tyre can have K* of a condition; None if none can."""
    assert one.recorded is not None
    recorded = replace(one.recorded, likelihood=likelihood)
    data = recorded(recorded.ratio * likelihood.stiffness[recorded.places])
    known = {"k1": one.own.k1, "k1_std": one.own.k1_std, "recorded": np.array(recorded, dtype=object)}
    verdict = check_possible(replace(data, reference=None, **known))
    if not verdict.possible:
        return None
    z = likelihood.around(recorded.places, verdict.best / recorded.ratio).z
    return float(z[-1] * likelihood.problem.shared.std[-1])


def _without_error(likelihood: Likelihood, source: Source, value: float, std: float) -> Likelihood:
    """The likelihood of the amplitudes without an error, which then is uncertain by `std`; its place is the last."""
    problem, shared, error = likelihood.problem, likelihood.problem.shared, likelihood.problem.errors.index(source)
    kept = tuple(one for one in shared.parameters if one.source != source)
    shared = replace(shared, parameters=(*kept, SharedParameter(source, "1", error, 0.0, std)))
    observed = problem.observed
    true = observed.amplitudes * np.exp(-observed.turns_of_all[:, :, error] * value)
    problem = replace(problem, observed=replace(observed, amplitudes=true), shared=shared)
    found = solve(problem, likelihood.stiffness)
    return Likelihood(problem, found.z, found.stiffness)
