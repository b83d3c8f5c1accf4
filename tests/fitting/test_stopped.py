"""Found work is never lost: a stop, or a model that fails, leaves what was found before it."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from fourpole.fitting import modelling
from fourpole.fitting.measured import MeasuredSet, measured_of
from fourpole.models import choice, profile
from fourpole.models.families import model_named

FREQUENCY = np.geomspace(1.0, 100.0, 12)


def rubber(tyres=("a",), noise: float = 0.01) -> MeasuredSet:
    k = model_named("fractional").stiffness([1e5, 5e5, 1e-3, 0.5], 2 * np.pi * FREQUENCY)
    rng = np.random.default_rng(1)
    rows = []
    for tyre in tyres:
        own = k * (1 + noise * (rng.standard_normal(12) + 1j * rng.standard_normal(12)))
        rows += [
            {"tyre": tyre, "frequency [Hz]": f, "Re K* [N/m]": one.real, "Im K* [N/m]": one.imag}
            for f, one in zip(FREQUENCY, own, strict=True)
        ]
    return measured_of(pl.DataFrame(rows), std=0.01)


def stop(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


def after(count: int, real):
    """A function that works so many times, then is stopped."""
    calls = iter(range(count))

    def run(*given, **named):
        if next(calls, None) is None:
            raise KeyboardInterrupt
        return real(*given, **named)

    return run


def test_models_found_before_a_stop_are_compared(monkeypatch):
    monkeypatch.setattr(choice, "_candidate", after(2, choice._candidate))
    (found,) = modelling.fit_tyres(rubber())
    assert {one.name for one in found.choice.candidates} == {"spring", "kelvin"}
    assert "zener was not compared: stopped by Ctrl-C" in found.choice.text
    assert np.isfinite(found.intervals[0]).all()


def test_a_stop_before_the_first_model_is_a_stop(monkeypatch):
    monkeypatch.setattr(choice, "_candidate", stop)
    with pytest.raises(KeyboardInterrupt):
        modelling.fit_tyres(rubber())


def test_a_stop_in_the_profiles_leaves_the_fit(monkeypatch):
    monkeypatch.setattr(profile, "profiles_together", stop)
    (found,) = modelling.fit_tyres(rubber(), "zener")
    assert "Profile likelihood was stopped by Ctrl-C" in found.choice.text
    ends, values = found.intervals[0], found.chosen.fit.values
    assert ((ends[:, 0] < values) & (values < ends[:, 1])).all()


def test_a_stop_in_the_second_tyre_leaves_the_first(monkeypatch):
    monkeypatch.setattr(modelling, "_fit_tyre", after(1, modelling._fit_tyre))
    (found,) = modelling.fit_tyres(rubber(("a", "b")), "zener")
    assert found.tyre == "a"
    assert "Not fitted, stopped by Ctrl-C: 'b'" in found.choice.text


def test_a_model_whose_algebra_fails_leaves_the_others(monkeypatch):
    def singular(model, *given, real=choice._candidate):
        if model.name == "fractional":
            raise np.linalg.LinAlgError("Singular matrix")
        return real(model, *given)

    monkeypatch.setattr(choice, "_candidate", singular)
    (found,) = modelling.fit_tyres(rubber())
    assert "fractional was not compared: its fit failed (Singular matrix)" in found.choice.text


def test_many_parameters_have_intervals_from_the_covariance_and_that_is_said(monkeypatch):
    monkeypatch.setattr(profile, "_MOST_WORK", 10)
    (found,) = modelling.fit_tyres(rubber(), "zener")
    assert "3 free parameters are too many for profile likelihood" in found.choice.text
    half = 1.96 * found.chosen.fit.std / found.chosen.fit.values
    assert found.intervals[0][:, 1] == pytest.approx(found.chosen.fit.values * np.exp(half), rel=1e-3)
