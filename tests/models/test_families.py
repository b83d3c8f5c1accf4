"""Every family of the registry keeps its contract, and so does one that flows, which no family of the registry does."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fourpole import models
from fourpole.errors import ModelError
from fourpole.models import choice, families
from fourpole.models.choice import choose, fit_conditions
from fourpole.models.data import StiffnessData
from fourpole.models.families import (
    FAMILIES,
    NAMED,
    NAMES,
    automatic,
    check_several,
    contains,
    for_maps,
    model_named,
    sizes_of,
)  # fmt: skip
from fourpole.models.fit import best_fit
from fourpole.models.interface import Model, Parameter, columns, positive
from fourpole.models.maxwell import Zener
from fourpole.models.problem import starts_of
from fourpole.models.profile import profile_intervals
from fourpole.models.together import fit_together

OMEGA = 2 * np.pi * np.geomspace(1.0, 100.0, 15)
AMPLITUDES = np.tile([0.1e-3, 0.5e-3, 2e-3], 5)
MEMBERS = [key.replace("[:N]", ":3").replace(":N", ":2") for key in (*FAMILIES, *NAMED)]
DOCS = Path(__file__).parents[2] / "docs"


class Damper(Model):
    """A damper by itself, K* = jwC: it flows."""

    name = "damper"
    parameters = (Parameter("C", "N s/m", 0.0, np.inf, 300.0, "damper", log=True),)
    rests = False
    special_case_of = ("kelvin",)

    def stiffness(self, values, omega):
        (c,) = columns(self.checked(values))
        return 1j * positive(omega) * c

    def derivative(self, values, omega):
        return 1j * positive(omega)[..., None] + 0 * self.stiffness(values, omega)[..., None]

    def starts(self, data, count):
        return np.mean(data.stiffness.imag / data.omega, axis=1)[None, :, None]


def usual(model):
    """Usual values; exponents and orders moved off zero and one, where derivatives vanish or have an end."""
    plain = {"1": 0.4}
    return np.array([plain.get(one.unit, one.default) for one in model.parameters])


ALL = [*(model_named(one).at_amplitude(AMPLITUDES) for one in MEMBERS), Damper()]


@pytest.fixture(params=ALL, ids=lambda one: one.name)
def model(request):
    return request.param


def test_the_name_leads_back_to_the_model():
    for name in MEMBERS:
        assert model_named(name).name == name
        assert type(model_named(name)).__doc__


@pytest.mark.parametrize(
    "name", ["maxwel", "maxwell", "maxwell:x", "maxwell:0", "maxwell:61", "gehman", "spring:1", ""]
)
def test_names_that_are_none(name):
    with pytest.raises(ModelError):
        model_named(name)


def test_symbols_are_distinct_and_defaults_within_bounds(model):
    symbols = [one.symbol for one in model.parameters]
    assert len(set(symbols)) == len(symbols)
    assert set(model.usually_fixed) <= set(symbols)
    model.checked(model.defaults)


def test_derivatives_are_those_of_the_stiffness(model):
    """Central differences with steps h of 1e-5: their error, h² f'''/6 and 1e-16/h, is below 1e-8 of |K*|."""
    values = usual(model)
    found = model.derivative(values, OMEGA)
    for at, value in enumerate(values):
        moved = np.array([values, values])
        moved[:, at] += [1e-5 * value, -1e-5 * value]
        above, below = model.stiffness(moved, OMEGA)
        size = np.abs(model.stiffness(values, OMEGA)).max() / abs(value)
        assert np.abs(found[:, at] - (above - below) / (2e-5 * value)).max() < 1e-8 * size


@pytest.mark.sampled(2)
def test_starts_are_finite_within_the_bounds_and_cost_little_more_than_the_fit(model):
    values = usual(model)
    data = StiffnessData.of(OMEGA, model.stiffness(values, OMEGA), 1e2)
    starts = starts_of(model, data, 4)
    assert starts.shape == (4, len(values))
    for one in starts:
        assert np.all(np.isfinite(model.stiffness(model.checked(one), OMEGA)))
    off = model.stiffness(starts[0], OMEGA) / data.stiffness - 1
    # the shell starts at its usual size, without knowing inertia; all others are closed forms or grids
    assert np.sqrt(np.mean(np.abs(off) ** 2)) < (0.5 if model.name == "shell" else 0.1)
    if len(values) < 2 * OMEGA.size - 5 and not model.usually_fixed:
        assert float(best_fit(model, data, starts).chi2) < OMEGA.size


def test_whether_it_rests_is_what_its_stiffness_tends_to(model):
    """At 1e-15 Hz: powers of 0.16, the least here, are within 1 % of their end."""
    if model.by_amplitude:
        return  # its law of the amplitude, and so its K1, is of one amplitude
    if not model.causal:
        assert model.rests  # a law of the frequency is no model at rest: it says its K1 by name
        return
    values = usual(model)
    slow = model.stiffness(values, [2 * np.pi * 1e-15])[0].real
    static = float(model.static_stiffness(values))
    assert (static > 0) == model.rests
    assert slow == pytest.approx(static, rel=0.02, abs=1e-6)
    by = model.static_derivative(values)
    assert np.any(by != 0) == model.rests


def test_the_state_space_is_the_model(model):
    values = usual(model)
    try:
        system = model.state_space(values)
    except ModelError:
        assert not model.causal or "fractional" in model.name or model.name == "damper"
        return
    assert model.causal
    np.testing.assert_allclose(system.stiffness(OMEGA), model.stiffness(values, OMEGA), rtol=1e-9)


def test_a_relaxing_family_loses_energy_and_stiffens_with_frequency(model):
    if not model.relaxing:
        return
    k = model.stiffness(usual(model), OMEGA)
    assert np.all(k.imag >= 0)
    assert np.all(np.diff(k.real) >= -1e-9 * np.abs(k[1:]))


def test_what_auto_and_maps_try_is_there():
    assert "auto" not in automatic()
    for name in automatic():
        assert sizes_of(name) or model_named(name).name.partition(":")[0] == name
    for name in for_maps():
        assert model_named(name).name == name
    assert all(model_named(name).causal for name in for_maps())


def test_models_of_one_condition_are_neither_tried_nor_compared_nor_mapped():
    named = {key.partition(":")[0] for key in NAMED}
    assert not named & {name.partition(":")[0] for name in (*automatic(), *for_maps())}
    assert not any(contains(name, "spring") for name in named)
    for name in ("structural", "gehman:2", "shell"):
        with pytest.raises(ModelError, match=f"{name} model is for one condition.*fourpole map makes a map of zener"):
            check_several(name)
    for name in (*automatic(), "kraus", "prony:2", "auto", "no such"):
        check_several(name)


def test_automatic_choices_do_without_the_room_of_the_paper():
    """Models that can be taken out: no list of candidates loads them."""
    code = (
        "import sys\nfrom fourpole.models.families import automatic, contains, for_maps\nautomatic(), for_maps()\n"
        "contains('zener', 'spring')\nprint(any('paper1982' in name for name in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_special_cases_hold_at_second_hand_and_by_size():
    assert contains("zener", "spring")
    assert contains("maxwell:2", "zener")
    assert contains("gehman:2", "gehman:1")
    assert not contains("maxwell:2", "maxwell:2")
    assert not contains("zener", "zener")
    assert not contains("fractional", "fractional5")
    assert not contains("kelvin", "zener")


def test_what_a_newcomer_says_of_itself_is_taken(monkeypatch):
    """A line of the registry and a class: name, `auto`, help and special cases follow."""
    places = {**families._PLACES, "damper": ("damper", "fourpole.models.springs.Damper")}
    monkeypatch.setattr(families, "_PLACES", places)
    monkeypatch.setattr("fourpole.models.springs.Damper", Damper, raising=False)
    families._special_cases.cache_clear()
    assert model_named("damper").name == "damper"
    assert automatic()[-1] == "damper"
    assert contains("kelvin", "damper")
    assert not contains("zener", "damper")
    monkeypatch.undo()
    families._special_cases.cache_clear()
    assert not contains("kelvin", "damper")


def test_a_model_that_flows_is_not_held_against_k1():
    """A static stiffness of 180 kN/m, known to 1 N/m, shifts neither fit, interval nor degrees of freedom."""
    clean = Damper().stiffness([700.0], OMEGA)
    plain = StiffnessData.of(OMEGA, clean, 100.0)
    known = StiffnessData.of(OMEGA, clean, 100.0, k1=180e3, k1_std=1.0)
    (alone,), (beside,) = fit_conditions(Damper(), [plain]), fit_conditions(Damper(), [known])
    assert beside.dof == alone.dof == 2 * OMEGA.size - 1
    np.testing.assert_array_equal(beside.values, alone.values)
    assert beside.chi2 < 1e-6
    np.testing.assert_array_equal(profile_intervals(beside, known), profile_intervals(alone, plain))
    start = np.array([[650.0]])
    (shared,) = fit_together(Damper(), [known], start, {"C": np.ones((1, 1))}).fits()
    assert shared.values[0] == pytest.approx(700.0, rel=1e-6)
    (held,) = fit_conditions(Zener(), [known])
    assert held.dof == 2 * OMEGA.size + 1 - 3


def test_models_that_flow_and_that_rest_are_compared_on_the_same_data(monkeypatch):
    """K1 costs one that flows a parameter of its own: so its BIC counts as many data as that of one that rests."""
    monkeypatch.setattr(choice, "model_named", lambda name: Damper() if name == "damper" else model_named(name))
    data = StiffnessData.of(OMEGA, Damper().stiffness([700.0], OMEGA), 100.0, k1=180e3, k1_std=1e3)
    (only,) = choose(data, ["damper"]).candidates
    assert only.bic - only.chi2 == pytest.approx(2 * np.log(2 * OMEGA.size + 1))


def test_the_docs_and_the_help_name_every_family():
    from fourpole.app.group import signature_of

    which = (DOCS / "which-model.md").read_text(encoding="utf-8")
    for key in (*FAMILIES, *NAMED):
        name = key.partition("[")[0].partition(":")[0]
        assert re.search(rf"^\| `{name}\b", which, re.MULTILINE), name
    assert signature_of("fit").parameters["model"].default.help.startswith(NAMES)


def test_each_family_is_a_class_of_the_package():
    classes = {place.rpartition(".")[2] for place in (*FAMILIES.values(), *NAMED.values())}
    assert classes == set(dir(models))
    for name in classes:
        assert issubclass(getattr(models, name), Model)
        assert f"`{name}`" in models.__doc__
    with pytest.raises(AttributeError, match="no attribute 'Zenner'; its models are Spring"):
        _ = models.Zenner


def test_importing_the_package_loads_no_family():
    code = "import sys, fourpole.models; print('numpy' in sys.modules or 'fourpole.models.maxwell' in sys.modules)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "False"
