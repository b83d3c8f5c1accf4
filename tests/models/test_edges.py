"""Numbers that decide a verdict on K*, a choice of models or a shift: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models import causality, choice, ladder, realised, shift_law, superposition, surface_choice
from fourpole.models.common_curve import Isotherm
from fourpole.models.data import StiffnessData
from fourpole.models.kraus import Separation
from fourpole.models.ladder import Of, Rung
from fourpole.models.maxwell import Zener
from fourpole.models.operating import OperatingMap
from fourpole.models.problem import Recorded, bends
from fourpole.models.shift_law import LEVEL, ONE_CURVE, TOO_SHORT, _overlap

LN_10 = np.log(10.0)


def some(count=20):
    """Data of a Zener tyre at some frequencies."""
    omega = np.geomspace(10.0, 100.0, count)
    return StiffnessData.of(omega, Zener().stiffness([180e3, 120e3, 700.0], omega), 100.0)


def alike(bic):
    """Models as good as the best, of one that is worse by a difference of BIC."""
    return choice._as_good([SimpleNamespace(name="zener", bic=0.0), SimpleNamespace(name="kelvin", bic=bic)])[0]


def compared(bic):
    """Whether a model gets a cross-validation error, by its BIC above the best, for two conditions."""
    trials = [choice.Trial((), 0.0, value) for value in (0.0, bic)]
    with patch.object(choice, "_cross_validation_error", lambda *given: 1.0):
        choice._cross_validate(trials, [None, None], [{}, {}])
    return trials[1].cross_validation == 1.0


def validated(count):
    """Whether a Zener tyre has a cross-validation error, by the number of frequencies."""
    data = [some(count)]
    trial = choice._candidate(Zener(), data, [{}])
    return bool(np.isfinite(choice._cross_validation_error(trial, data, [{}])))


def verdict(better, of_lie=np.inf, rung=Rung.MASS, of_wrong=np.inf):
    """The kind of specimen, where a higher one is better than a relaxing one by this, and an error worse, in BIC."""
    chi2, weight = 70.0, np.log(40)  # of the relaxing one, with one value; the higher one has five
    relaxing = MagicMock(chi2=chi2, dof=39, possible=False)
    tried = ladder._Best(chi2 - 4 * weight - better, 5, 40, 0.0, np.ones((int(rung is Rung.RESONANT), 2)))
    made = MagicMock(lies=lambda: [SimpleNamespace(bic=tried.bic + of_lie)], climbed=lambda of: [(rung, tried)])
    made.belt_of.return_value, made.with_one_wrong.return_value = None, tried.bic + of_wrong
    with patch.multiple(ladder, check_possible=lambda *given: relaxing, Ladder=lambda data: made):
        return ladder.verdict_of(some()).holds


def rungs(count):
    """Number of specimens that are tried, by the number of frequencies."""
    best = SimpleNamespace(chi2=1.0, dof=1)
    parts = dict.fromkeys(("with_pairs", "with_belt", "with_another"), lambda *given: best)
    return len(list(ladder.Ladder.climbed(SimpleNamespace(data=some(count), **parts), Of.DRIVING_POINT)))


def impossible(far=0.0, needed=99):
    """Number of frequencies that are named, by the largest residual, and by how many must go so that K* is possible."""
    data = some(10)

    def best(part, enough):
        return SimpleNamespace(possible=part.count <= 10 - needed, far=np.zeros(part.count))

    with patch.object(causality, "_best", best):
        return causality._impossible(data, np.append(far, np.zeros(9)))[0].size


def possible(chance):
    return causality.PassiveTyre(0.0, 1, chance, *[np.zeros(0)] * 4).possible


def scattered(gain):
    """Number of variances that are not zero, where each reduces -2 log L by this."""
    found = SimpleNamespace(conditions=SimpleNamespace(nodes=np.ones(1)), rows=[SimpleNamespace(static=1.0)])
    found.scatter = SimpleNamespace(variances=np.ones(7))

    def least(variances, unknown):
        return SimpleNamespace(variances=np.where(unknown, 1.0, 0.0), value=-gain * np.sum(unknown))

    with patch.multiple(surface_choice, _Likelihood=lambda found: SimpleNamespace(least=least), Scatter=MagicMock()):
        surface_choice.scatter_of(found)
        return int(np.sum(surface_choice.Scatter.of.call_args.args[0] > 0))


def decided(apart):
    """Whether one of two laws is chosen, by their difference of BIC."""
    laws = {"WLF": 10.0, "Arrhenius": 10.0 + apart}
    made = SimpleNamespace(t=np.zeros(3), fitted=lambda name: MagicMock(chi2=laws[name], values=np.zeros(1)))
    with patch.object(shift_law, "_Problem", lambda *given: made):
        return shift_law.fit_laws(np.arange(4.0), np.arange(4.0), np.eye(4), 0).decided


def isotherm(low=0.0, high=2.0, factor=1.0, count=41):
    omega = np.logspace(low, high, count)
    return Isotherm(20.0 + low + factor, omega, factor * 1e5 * (1j * omega) ** 0.2)


def linked(std=0.0, steps=0.0):
    """Number of isotherms that are linked, by the standard uncertainty of their distance, and points that are apart."""
    pair, log_a = [isotherm(count=9)] * 2, np.array([0.0, steps * 0.25 * LN_10])
    return len(superposition._linked(pair, log_a, 0, np.diag([0.0, std**2])))


def overlap(first, second):
    """Verdict on the overlap of two isotherms, of points that are known to 1e-4."""
    pair = first, second
    found = SimpleNamespace(
        isotherms=pair, log_a=np.zeros(2), log_b=np.zeros(2), vertical=False,
        errors=[1e-4 * np.abs(one.stiffness)[:, None] * np.ones(2) for one in pair],
        reduced=lambda at: (pair[at].omega, pair[at].stiffness),
    )  # fmt: skip
    return _overlap(found, 0, 0.01).verdict


def vertical(gain):
    """Whether isotherms need vertical shifts, by the difference of BIC."""
    found = MagicMock(isotherms=[isotherm()] * 2, loss=gain + np.log(4 * 41), stated=False)
    other = MagicMock(loss=0.0)
    parts = {"_joint": MagicMock(return_value=other), "_linked": lambda *given: [0, 1], "replace": lambda *_, **__: 1}
    with patch.multiple(superposition, **parts):
        return superposition._with_doubt(found) == 1


def approximated(able):
    """The accuracy of a model that arms approximate, which can do no better than this."""

    def rational(model, values, band, accuracy):
        if accuracy < able:
            raise ModelError("too many arms")
        return MagicMock(), None, accuracy

    with patch.multiple(realised, rational=rational, _of_arms=lambda arms, error: error):
        try:
            return realised._approximated(None, None, (1.0, 10.0))
        except ModelError:
            return None


def of_recording(ratio):
    """Whether K* of the data is that of the joint solution, by their ratio."""
    likelihood = SimpleNamespace(stiffness=np.ones(1))
    return Recorded.of(likelihood, [0], SimpleNamespace(stiffness=np.array([ratio]), omega=np.ones(1))) is not None


def bent(second):
    """Whether the second order of a shared error is above the noise, by their ratio."""
    own = SimpleNamespace(stiffness=np.ones(1), covariance=np.eye(2)[None])
    return bends(own, np.array([[np.sqrt(second)], [0.0]]))


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "models as good as the best, 6 in BIC": (alike, {5.94: ("kelvin",), 6.06: ()}),
    "models with a cross-validation, 30 in BIC for each condition": (compared, {59.4: True, 60.6: False}),
    "degrees of freedom of a cross-validation, 2": (validated, {3: False, 4: True}),
    "K* that is possible, 0.1 % by chance": (possible, {0.99e-3: False, 1.01e-3: True}),
    "frequency that is not possible, 3 u": (impossible, {2.97: 0, 3.03: 1}),
    "frequencies that are removed, 3": (lambda count: impossible(needed=count), {3: 3, 4: 0}),
    "specimen with a mass, better by 6 in BIC": (verdict, {5.94: Rung.NONE, 6.06: Rung.MASS}),
    "resonances, better than an error by 10 in BIC": (
        lambda x: verdict(20.0, x, Rung.RESONANT), {9.9: Rung.NONE, 10.1: Rung.RESONANT},
    ),
    "frequencies of resonances, 4 and 6 for each of up to 3": (rungs, {9: 1, 10: 3, 15: 3, 16: 4, 22: 5, 28: 5}),
    "resonances, better than a wrong frequency by 10 in BIC": (
        lambda x: verdict(20.0, np.inf, Rung.RESONANT, x), {9.9: Rung.NONE, 10.1: Rung.RESONANT},
    ),
    "variance that is zero, 10 % by chance": (scattered, {1.63: 0, 1.65: 7}),
    "law that is chosen, 2 in BIC": (decided, {1.98: False, 2.02: True}),
    "isotherms that are linked, a quarter of a decade": (
        lambda x: linked(x * LN_10), {0.2475: 2, 0.2525: 1},
    ),
    "isotherms that overlap, 2 points": (lambda steps: linked(steps=steps), {7.0: 2, 8.0: 1}),
    "overlap that is short, 0.3 decades": (
        lambda x: overlap(isotherm(), isotherm(2 - x, 4 - x)), {0.297: TOO_SHORT, 0.303: ONE_CURVE},
    ),
    "isotherms of two levels, 3 %": (
        lambda x: overlap(isotherm(), isotherm(factor=np.exp(x))), {0.0297: ONE_CURVE, 0.0303: LEVEL},
    ),
    "vertical shifts, 10 in BIC": (vertical, {9.9: False, 10.1: True}),
    "accuracy of arms, 1e-7 to 1e-3": (approximated, {0.99e-7: 1e-7, 1.01e-7: 1e-6, 0.99e-3: 1e-3, 1.01e-3: None}),
    "frequency inside a band, 1 %": (
        lambda f: bool(OperatingMap.octaves_beyond(SimpleNamespace(band=(10.0, 20.0)), f) > 0),
        {9.91: False, 9.89: True, 20.19: False, 20.21: True},
    ),
    "amplitude apart from frequency, inflation of 10": (
        lambda x: Separation(0.0, x, 1.0).possible, {9.9: True, 10.1: False},
    ),
    "amplitude apart from frequency, spread of 0.05": (
        lambda x: Separation(0.0, 1.0, x).possible, {0.0495: False, 0.0505: True},
    ),
    "K* of the recordings, within a half": (of_recording, {0.505: True, 0.495: False, 1.495: True, 1.505: False}),
    "second order of a shared error, 0.3 of the noise": (bent, {0.297: False, 0.303: True}),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
