"""A model fitted to K* over frequency from arrays, without a campaign."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fourpole import units
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import COVERAGE
from fourpole.errors import ModelError
from fourpole.models.choice import choose
from fourpole.models.data import StiffnessData
from fourpole.models.fit import Fit
from fourpole.models.profile import profile_intervals


@dataclass(frozen=True, eq=False)
class CurveFit(ByValue):
    """A model of K* that was fitted to one curve.

    Attributes
    ----------
    model : str
        Name of the model, by which `fourpole.models` and the commands know it.
    params, u : dict of str to float
        Parameters by symbol, each in its unit, and their standard uncertainties.
    units : dict of str to str
        Unit of each parameter.
    text : str
        How the model was chosen, and how well it fits.
    fit : Fit
        The fit with covariance, residuals and chi-square.
    data : StiffnessData
        The curve as it was fitted.
    """

    model: str
    params: dict[str, float]
    u: dict[str, float]
    units: dict[str, str]
    text: str
    fit: Fit
    data: StiffnessData

    def predict(self, frequency: ArrayLike) -> ComplexArray:
        """K* of the model (...,) [N/m] at frequencies (...,) [Hz] > 0."""
        omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        return self.fit.model.stiffness(self.fit.values, omega).reshape(omega.shape)

    def interval(self, symbol: str, level: float = COVERAGE) -> tuple[float, float]:
        """The interval of a parameter by profile likelihood, in its unit; ModelError for an unknown symbol."""
        if symbol not in self.params:
            near = units.nearest(symbol, self.params)
            hint = f"did you mean {near!r}?" if near else f"it has {', '.join(self.params)}"
            raise ModelError(f"{self.model} has no parameter {units.shown(symbol)}: {hint}")
        ends = profile_intervals(self.fit, self.data, level)[list(self.params).index(symbol)]
        return float(ends[0]), float(ends[1])


def fit(
    frequency: ArrayLike,
    k_star: ArrayLike,
    *,
    u: ArrayLike | str,
    model: str = "auto",
    k1: float | str = np.nan,
    u_k1: float | str = np.nan,
) -> CurveFit:
    """Fit a model to K* over frequency.

    Parameters
    ----------
    frequency : (N,) float array [Hz]
        > 0.
    k_star : (N,) complex array [N/m]
    u : float or (N,) float array [N/m], or a text
        Standard uncertainty of Re K* and of Im K*; as a text also relative: "0.5 %".
    model : str
        Name of a model, `maxwell` for as many arms as help, or `auto`: the model with the least BIC.
    k1, u_k1 : float [N/m] or text, optional
        Static stiffness and its standard uncertainty, for models that rest.

    Raises
    ------
    ModelError
        If there is no such model, K* is not known at enough frequencies, shapes differ, or u is not above 0.
    UnitError
        If a text is no quantity.

    Examples
    --------
    >>> from fourpole.models import Zener
    >>> frequency = np.geomspace(1.0, 100.0, 20)
    >>> k_star = Zener().stiffness([180e3, 120e3, 700.0], 2 * np.pi * frequency)
    >>> found = fit(frequency, k_star, u="0.1 %", model="zener")
    >>> {symbol: round(value) for symbol, value in found.params.items()}, abs(found.predict([10.0])).round(-3).tolist()
    ({'K1': 180000, 'K2': 120000, 'C': 700}, [198000.0])
    """
    hertz, stiffness = np.atleast_1d(np.asarray(frequency, dtype=float)), np.atleast_1d(np.asarray(k_star, complex))
    static = units.quantity(k1, "stiffness") if isinstance(k1, str) else float(k1)
    std, static_std = _std(u, stiffness), float(_std(u_k1, np.asarray(static)))
    if hertz.shape != stiffness.shape or std.shape not in ((), stiffness.shape):
        sizes = f"{hertz.size}, {stiffness.size} and {std.size}"
        raise ModelError(f"frequency, k_star and u have {sizes} values: give as many of each, or one u")
    if not (np.all(np.isfinite(std)) and np.all(std > 0)):
        raise ModelError("u is a standard uncertainty: give finite values above 0 N/m, or a text as '0.5 %'")
    if np.isfinite(static) and not static_std > 0:
        raise ModelError("k1 without its standard uncertainty counts for nothing: give u_k1, above 0 N/m")
    data = StiffnessData.of(2 * np.pi * hertz, stiffness, std, k1=static, k1_std=static_std)
    choice = choose(data, None if model == "auto" else (model,))
    best = choice.best.fit
    symbols = best.model.symbols
    return CurveFit(
        model=best.model.name,
        params=dict(zip(symbols, best.values.tolist(), strict=True)),
        u=dict(zip(symbols, best.std.tolist(), strict=True)),
        units={parameter.symbol: parameter.unit for parameter in best.model.parameters},
        text=choice.text,
        fit=best,
        data=data,
    )


def _std(u: ArrayLike | str, stiffness: ArrayLike) -> FloatArray:
    """Standard uncertainty of a stiffness [N/m] from a number, an array or a text."""
    if not isinstance(u, str):
        return np.asarray(u, dtype=float)
    return np.asarray(units.quantity(u, "ratio") * np.abs(stiffness) if "%" in u else units.quantity(u, "stiffness"))
