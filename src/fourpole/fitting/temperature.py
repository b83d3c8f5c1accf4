"""Shift factors of a master curve as a model file has them: those found, interpolated, and their law beyond."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.errors import ModelError
from fourpole.fitting.modelparts import LARGEST, Grown, NamedValue, Strict, check_covariance
from fourpole.models.data import DECADE, StiffnessData
from fourpole.models.fit import Fit, moved_by
from fourpole.models.laws import root_of
from fourpole.models.operating import Answer, OperatingMap
from fourpole.models.shift_law import CONSTANTS, ShiftLaw, interpolated, worst_miss

#: Most isotherms of a master curve.
_MOST = 1000
#: A temperature [degC].
Celsius = Annotated[float, Field(ge=-273.15, le=1e4)]
#: A matrix, row by row.
Rows = list[list[float]]
#: A temperature this little [K] beyond the isotherms is one of theirs, rounded.
_ROUNDED = 0.1


class VerticalFile(Strict):
    """The law of the vertical shift factor: ln(bT) is proportional to the difference from the reference temperature."""

    slope: float = Field(ge=-1, le=1, description="Slope of ln(bT) over temperature [1/K].")
    std: float = Field(ge=0, le=1, description="[1/K]")


@dataclass(frozen=True, eq=False)
class Shift(ByValue):
    """The shift of a master curve to a temperature.

    Attributes
    ----------
    log_a, log_b : float [1]
        Natural logarithms of the horizontal and vertical shift factors.
    errors_a, errors_b : (m,) float arrays [1]
        Their changes with m independent errors of one standard uncertainty.
    parameters : (P, m) float array
        Changes of the parameters of the model with these errors; their covariance has them already.
    remarks : tuple of str
        That a law gives the factors, where it does beyond the isotherms.
    """

    log_a: float
    log_b: float
    errors_a: FloatArray
    errors_b: FloatArray
    parameters: FloatArray
    remarks: tuple[str, ...] = ()

    def with_factor(self, which: str, log: float, errors: FloatArray, parameters: FloatArray | None = None) -> Shift:
        """The shift and a further factor, horizontal ("a") or vertical ("b"), with its errors."""
        before, more = self.errors_a.size, errors.size
        every = {name: np.pad(getattr(self, f"errors_{name}"), (0, more)) for name in "ab"}
        every[which][before:] = errors
        rows = len(self.parameters) if parameters is None else len(parameters)
        known = self.parameters if len(self.parameters) == rows else np.zeros((rows, before))
        new = np.zeros((rows, more)) if parameters is None else parameters
        logs = {"a": self.log_a, "b": self.log_b}
        logs[which] += log
        return Shift(logs["a"], logs["b"], every["a"], every["b"], np.concatenate([known, new], axis=1), self.remarks)

    @property
    def factor(self) -> float:
        """The horizontal shift factor."""
        return float(np.exp(self.log_a))

    def answer(self, found: OperatingMap, points: FloatArray, frequency: FloatArray) -> Answer:
        """K* at the temperature and the frequencies [Hz]; its uncertainty includes that of the shift factors."""
        step, b = 1e-4, float(np.exp(self.log_b))
        reduced = frequency * self.factor
        here = found.ask(points, reduced)
        above, below = (found.ask(points, reduced * np.exp(side)).stiffness for side in (step, -step))
        slope = (above - below) / (2 * step)
        rows = np.stack([slope.real, slope.imag, np.zeros(frequency.size)], axis=1)
        level = np.stack([here.stiffness.real, here.stiffness.imag, here.k1], axis=1)
        moved = rows[..., None] * self.errors_a - level[..., None] * self.errors_b
        covariance = here.covariance + moved @ np.swapaxes(moved, 1, 2)
        if self.parameters.size:  # at an isotherm the curve has the errors of its shift, too, and both cancel
            values = found.model.unlink(found.coefficients[:, 0])[0]
            by = found.model.derivative(values, 2 * np.pi * reduced)
            rest = np.broadcast_to(found.model.static_derivative(values), by.shape)
            both = np.stack([by.real, by.imag, rest], axis=1) @ self.parameters @ np.swapaxes(moved, 1, 2)
            covariance = covariance + both + np.swapaxes(both, 1, 2)
        return Answer.of(here.stiffness / b, here.k1 / b, covariance / b**2, 2 * np.pi * frequency)


NO_SHIFT = Shift(0.0, 0.0, np.zeros(0), np.zeros(0), np.zeros((0, 0)))


class ShiftsFile(Strict):
    """The shift factors that were found, rising in temperature."""

    temperatures: list[Celsius] = Field(min_length=2, max_length=_MOST, description="Mean of each isotherm [degC].")
    tests: list[str] = Field(max_length=_MOST, description="Name of each isotherm in the table of the master curve.")
    log10_a: list[float] = Field(max_length=_MOST, description="log10(aT) [1].")
    covariance_a: Rows = Field(max_length=_MOST, description="Covariance of log10_a; 0 at the reference.")
    log10_b: list[float] = Field(default_factory=list, max_length=_MOST, description="log10(bT) [1]; []: bT is 1.")
    covariance_b: Rows = Field(default_factory=list, max_length=_MOST, description="Covariance of log10_b.")
    sensitivity_a: Rows = Field(
        default_factory=list, max_length=_MOST, description="Derivatives of the parameters by log10_a."
    )
    sensitivity_b: Rows = Field(default_factory=list, max_length=_MOST, description="The same by log10_b.")

    @property
    def kinds(self) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """ln(aT), and ln(bT) if there is one: values (n,), their errors (n, n), derivatives (P, n) of parameters."""
        every = [(self.log10_a, self.covariance_a, self.sensitivity_a)]
        every += [(self.log10_b, self.covariance_b, self.sensitivity_b)] if self.log10_b else []
        return [
            (DECADE * np.array(values), DECADE * root_of(np.array(rows)), np.array(slopes) / DECADE)
            for values, rows, slopes in every
        ]

    def at(self, temperature: float) -> Shift:
        """The shift to a temperature among the isotherms."""
        shift = NO_SHIFT
        for at, (values, root, slopes) in enumerate(self.kinds):
            value, changes, error = interpolated(np.array(self.temperatures), values, root, temperature)
            parameters = np.pad(slopes @ root, ((0, 0), (0, 1))) if slopes.size else None
            shift = shift.with_factor(("a", "b")[at], value, np.append(changes, error), parameters)
        return shift


class TemperatureFile(Grown):
    """The shift factors of a master curve: K*(f, T) = K*(f aT, reference) / bT."""

    later: ClassVar = ("shifts",)
    law: Literal["WLF", "Arrhenius"] = Field(
        description="WLF: log10 aT = -C1 dT/(C2 + dT), dT = T - reference. Arrhenius: ln aT = E/R (1/T - 1/reference)."
    )
    reference: Celsius = Field(description="Reference temperature of the model [degC].")
    constants: list[NamedValue] = Field(max_length=2, description="C1 [1] and C2 [K], or E [J/mol].")
    covariance: list[list[float]] = Field(max_length=2, description="Covariance of the constants.")
    range: tuple[Celsius, Celsius] = Field(description="Lowest and highest temperature of the isotherms [degC].")
    vertical: VerticalFile | None = Field(default=None, description="null: bT is 1.")
    decided: bool = Field(default=True, description="Whether the shift factors prefer this law to the other.")
    shifts: ShiftsFile | None = Field(
        default=None, description="The factors found; the law then holds beyond them only. null: everywhere."
    )

    @property
    def shift_law(self) -> ShiftLaw:
        """The law as `models` has it."""
        values = np.array([one.value for one in self.constants], dtype=float)
        covariance = np.array(self.covariance, dtype=float).reshape(values.size, values.size)
        return ShiftLaw(self.law, self.reference, values, covariance)

    def at(self, temperature: float) -> Shift:
        """The shift to a temperature: interpolated among the isotherms, continued from the next one by the law."""
        law, slope = self.shift_law, (0.0, 0.0) if self.vertical is None else (self.vertical.slope, self.vertical.std)
        there = self.reference if self.shifts is None else float(np.clip(temperature, *self.range))
        found = NO_SHIFT if self.shifts is None else self.shifts.at(there)
        if there == temperature:
            return found
        onward, apart = law.at_reference(there), temperature - there
        found = found.with_factor("a", float(onward.log_a(temperature)[0]), onward.log_a_std(temperature))
        found = found.with_factor("b", slope[0] * apart, np.array([slope[1] * apart]))
        far = self.shifts is not None and abs(apart) >= _ROUNDED
        return replace(found, remarks=(self._beyond(law),)) if far else found

    def fitted(
        self, tests: Sequence[str], data: StiffnessData, fit: Fit, ends: FloatArray
    ) -> tuple[TemperatureFile, Fit, FloatArray]:
        """The file with what the fit of the master curve takes from each shift; the fit and its intervals with this.

        The fit takes reduced K* as if the shifts were exact: an error of one moves its isotherm along the curve, and
        the parameters by the weighted least squares of the fit.
        """
        if self.shifts is None or not set(tests) <= set(self.shifts.tests):
            return self, fit, ends
        mine = np.array(tests)[:, None] == np.array(self.shifts.tests)
        model, step = fit.model, 1e-4
        above, below = (model.stiffness(fit.values, data.omega * np.exp(side)) for side in (step, -step))
        moved = ((below - above) / (2 * step), data.stiffness)[: len(self.shifts.kinds)]
        by = [moved_by(model, fit.values, fit.covariance, data, one[:, None] * mine) for one in moved]
        roots = [slopes @ root for slopes, (_, root, _) in zip(by, self.shifts.kinds, strict=True)]
        names = ("sensitivity_a", "sensitivity_b")
        found = {name: (DECADE * one).tolist() for name, one in zip(names, by, strict=False)}
        shifts = self.shifts.model_copy(update=found)
        more = np.sum([one @ one.T for one in roots], axis=0)
        values, half = fit.values[:, None], NORMAL_95 * np.sqrt(np.diag(more))[:, None]
        ends = np.maximum(values + np.sign(ends - values) * np.hypot(ends - values, half), model.bounds[0][:, None])
        return self.model_copy(update={"shifts": shifts}), replace(fit, covariance=fit.covariance + more), ends

    def _beyond(self, law: ShiftLaw) -> str:
        assert self.shifts is not None
        low, high = self.range
        said = f"beyond the tested {low:.4g} to {high:.4g} °C: by the {self.law} law"
        values, std = np.array(self.shifts.log10_a), np.sqrt(np.diag(np.array(self.shifts.covariance_a)))
        where, miss, u = worst_miss(law, np.array(self.shifts.temperatures), values * DECADE, std * DECADE)
        return said if miss <= 2 * u else f"{said}, which misses the shift found at {where:.4g} °C by {_decades(miss)}"


def _decades(log: float) -> str:
    return f"{log / DECADE:.2g} decades"


def miss_in_words(law: ShiftLaw, temperatures: FloatArray, log_a: FloatArray, std: FloatArray) -> str:
    """Where a law misses its own shift factors most, in standard uncertainties of these: size and temperature."""
    where, miss, u = worst_miss(law, temperatures, log_a, std)
    return f"by {_decades(miss)} at {where:.4g} degC, where their u is {u / DECADE:.2g}"


def check_temperature(where: str, file: TemperatureFile, size: int) -> None:
    """ModelError unless the shift factors and their law are consistent, for a model of `size` parameters."""
    if [(one.name, one.unit) for one in file.constants] != list(CONSTANTS[file.law]):
        named = ", ".join(f"{name} [{unit}]" for name, unit in CONSTANTS[file.law])
        raise ModelError(f"{where}: a law {file.law} has the constants {named}: it was changed")
    if not file.range[0] <= file.reference <= file.range[1]:
        raise ModelError(f"{where}: the reference temperature is outside the range: it was changed")
    if max(abs(one.value) for one in file.constants) > LARGEST:
        raise ModelError(f"{where}: a number is beyond all measure: it was changed")
    check_covariance(where, file.covariance, len(file.constants))
    if file.law == "WLF" and file.constants[1].value + file.range[0] - file.reference <= 0:
        raise ModelError(f"{where}: the WLF law ends within its range, for C2 is too small: it was changed")
    if file.shifts is not None:
        _check_shifts(f"{where}, shifts", file.shifts, file.range, size)


def _check_shifts(where: str, shifts: ShiftsFile, ends: tuple[float, float], size: int) -> None:
    temperatures = shifts.temperatures
    if (temperatures[0], temperatures[-1]) != ends or np.any(np.diff(temperatures) <= 0):
        raise ModelError(f"{where}: the temperatures do not rise from end to end of the range: it was changed")
    if len(shifts.tests) != len(temperatures):
        raise ModelError(f"{where}: {len(shifts.tests)} names for {len(temperatures)} temperatures: it was changed")
    for slopes in (shifts.sensitivity_a, shifts.sensitivity_b):
        if slopes and (len(slopes) != size or {len(row) for row in slopes} != {len(temperatures)}):
            raise ModelError(f"{where}: the derivatives are not {size} by {len(temperatures)}: it was changed")
    for values, covariance in ((shifts.log10_a, shifts.covariance_a), (shifts.log10_b, shifts.covariance_b)):
        if values is shifts.log10_b and not values and not covariance:
            continue
        if len(values) != len(temperatures) or max(map(abs, values)) > LARGEST:
            raise ModelError(f"{where}: {len(values)} factors for {len(temperatures)} temperatures: it was changed")
        check_covariance(where, covariance, len(values))
