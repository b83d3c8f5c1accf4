"""Shift factors of a master curve as a model file has them: those found, interpolated, and their law beyond."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fourpole.core.arrays import FloatArray
from fourpole.errors import ModelError
from fourpole.fitting.modelparts import LARGEST, NamedValue, Strict, check_covariance
from fourpole.models.shift_law import CONSTANTS, ShiftLaw, interpolated, worst_miss

_DECADE = np.log(10.0)
#: Most isotherms of a master curve.
_MOST = 1000
#: A temperature [degC].
Celsius = Annotated[float, Field(ge=-273.15, le=1e4)]
#: A temperature this little [K] beyond the isotherms is one of theirs, rounded.
_ROUNDED = 0.1


class VerticalFile(Strict):
    """The law of the vertical shift factor: ln(bT) is proportional to the difference from the reference temperature."""

    slope: float = Field(ge=-1, le=1, description="Slope of ln(bT) over temperature [1/K].")
    std: float = Field(ge=0, le=1, description="[1/K]")


class ShiftsFile(Strict):
    """The shift factors that were found, rising in temperature."""

    temperatures: list[Celsius] = Field(min_length=2, max_length=_MOST, description="Mean of each isotherm [degC].")
    log10_a: list[float] = Field(max_length=_MOST, description="log10(aT) [1].")
    covariance_a: list[list[float]] = Field(max_length=_MOST, description="Covariance of log10_a; 0 at the reference.")
    log10_b: list[float] = Field(default_factory=list, max_length=_MOST, description="log10(bT) [1]; []: bT is 1.")
    covariance_b: list[list[float]] = Field(
        default_factory=list, max_length=_MOST, description="Covariance of log10_b; [] if bT is 1."
    )

    def log_a(self, temperature: float) -> tuple[float, float]:
        """ln(aT) at a temperature among them, and its standard uncertainty."""
        return self._at(temperature, self.log10_a, self.covariance_a)

    def log_b(self, temperature: float) -> tuple[float, float]:
        """ln(bT) at a temperature among them, and its standard uncertainty."""
        return self._at(temperature, self.log10_b, self.covariance_b) if self.log10_b else (0.0, 0.0)

    def _at(self, temperature: float, values: list[float], covariance: list[list[float]]) -> tuple[float, float]:
        found = interpolated(np.array(self.temperatures), np.array(values), np.array(covariance), temperature)
        return found[0] * _DECADE, found[1] * _DECADE


@dataclass(frozen=True)
class Shift:
    """The shift from the reference to a temperature.

    Attributes
    ----------
    log_a, log_a_std, log_b, log_b_std : float [1]
        Natural logarithms of the horizontal and vertical shift factors, with their standard uncertainties.
    remarks : tuple of str
        Where a law gives the factors, beyond the isotherms: that it does.
    """

    log_a: float
    log_a_std: float
    log_b: float
    log_b_std: float
    remarks: tuple[str, ...] = ()


class TemperatureFile(Strict):
    """The shift factors of a master curve: K*(f, T) = K*(f aT, reference) / bT."""

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
        """The shift at a temperature: interpolated among the isotherms, continued from the next one by the law."""
        law, slope = self.shift_law, (0.0, 0.0) if self.vertical is None else (self.vertical.slope, self.vertical.std)
        if self.shifts is None:
            apart = temperature - self.reference
            return Shift(*_by_law(law, temperature), slope[0] * apart, slope[1] * abs(apart))
        end = float(np.clip(temperature, *self.range))
        (log_a, std), (log_b, std_b) = self.shifts.log_a(end), self.shifts.log_b(end)
        if end == temperature:
            return Shift(log_a, std, log_b, std_b)
        (more, std_more), apart = _by_law(law.at_reference(end), temperature), temperature - end
        stds = np.hypot(std, std_more), np.hypot(std_b, slope[1] * apart)
        remarks = () if abs(apart) < _ROUNDED else (self._beyond(law),)
        return Shift(log_a + more, float(stds[0]), log_b + slope[0] * apart, float(stds[1]), remarks)

    def _beyond(self, law: ShiftLaw) -> str:
        assert self.shifts is not None
        low, high = self.range
        said = f"beyond the tested {low:.4g} to {high:.4g} °C: by the {self.law} law"
        values, std = np.array(self.shifts.log10_a), np.sqrt(np.diag(np.array(self.shifts.covariance_a)))
        where, miss, u = worst_miss(law, np.array(self.shifts.temperatures), values * _DECADE, std * _DECADE)
        return said if miss <= 2 * u else f"{said}, which misses the shift found at {where:.4g} °C by {_decades(miss)}"


def _decades(log: float) -> str:
    return f"{log / _DECADE:.2g} decades"


def _by_law(law: ShiftLaw, temperature: float) -> tuple[float, float]:
    """ln(aT) and its standard uncertainty."""
    return float(law.log_a(temperature)[0]), float(law.log_a_std(temperature)[0])


def miss_in_words(law: ShiftLaw, temperatures: FloatArray, log_a: FloatArray, std: FloatArray) -> str:
    """Where a law misses its own shift factors most, in standard uncertainties of these: size and temperature."""
    where, miss, u = worst_miss(law, temperatures, log_a, std)
    return f"by {_decades(miss)} at {where:.4g} degC, where their u is {u / _DECADE:.2g}"


def check_temperature(where: str, file: TemperatureFile) -> None:
    """ModelError unless the shift factors and their law are consistent."""
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
        _check_shifts(f"{where}, shifts", file.shifts, file.range)


def _check_shifts(where: str, shifts: ShiftsFile, ends: tuple[float, float]) -> None:
    temperatures = shifts.temperatures
    if (temperatures[0], temperatures[-1]) != ends or np.any(np.diff(temperatures) <= 0):
        raise ModelError(f"{where}: the temperatures do not rise from end to end of the range: it was changed")
    for values, covariance in ((shifts.log10_a, shifts.covariance_a), (shifts.log10_b, shifts.covariance_b)):
        if values is shifts.log10_b and not values and not covariance:
            continue
        if len(values) != len(temperatures) or max(map(abs, values)) > LARGEST:
            raise ModelError(f"{where}: {len(values)} factors for {len(temperatures)} temperatures: it was changed")
        check_covariance(where, covariance, len(values))
