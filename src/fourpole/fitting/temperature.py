"""Shift factors of a master curve as a model file has them: those found, interpolated, and their law beyond."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError
from fourpole.fitting.modelparts import LARGEST, NamedValue, Strict, check_covariance
from fourpole.models.operating import Answer, OperatingMap
from fourpole.models.shift_law import CONSTANTS, ShiftLaw, interpolated, root_of, worst_miss

_DECADE = np.log(10.0)
#: Most isotherms of a master curve.
_MOST = 1000
#: A temperature [degC].
Celsius = Annotated[float, Field(ge=-273.15, le=1e4)]
#: Frequencies from low to high [Hz].
Band = tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]]
#: A frequency is at least this, so that it has a logarithm [Hz].
_LEAST = 1e-300
#: Distance [decades] that round-off leaves between equal places of a master curve.
_SAME_PLACE = 1e-6
#: A temperature this little [K] beyond the isotherms is one of theirs, rounded.
_ROUNDED = 0.1


class VerticalFile(Strict):
    """The law of the vertical shift factor: ln(bT) is proportional to the difference from the reference temperature."""

    slope: float = Field(ge=-1, le=1, description="Slope of ln(bT) over temperature [1/K].")
    std: float = Field(ge=0, le=1, description="[1/K]")


@dataclass(frozen=True, eq=False)
class Shift(ByValue):
    """The shift of a master curve to a temperature, for some frequencies.

    Attributes
    ----------
    log_a, log_b : float [1]
        Natural logarithms of the horizontal and vertical shift factors.
    std_a, std_b : (N,) float arrays [1]
        Their standard uncertainties at each frequency.
    remarks : tuple of str
        That a law gives the factors, where it does beyond the isotherms.
    """

    log_a: float
    log_b: float
    std_a: FloatArray
    std_b: FloatArray
    remarks: tuple[str, ...] = ()

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
        slope = (above - below) / (2 * step) * self.std_a / b
        stiffness, k1 = here.stiffness / b, here.k1 / b
        columns = np.zeros((frequency.size, 3, 2))
        columns[:, 0, 0], columns[:, 1, 0] = slope.real, slope.imag
        columns[:, :, 1] = np.stack([stiffness.real, stiffness.imag, k1], axis=1) * self.std_b[:, None]
        covariance = here.covariance / b**2 + columns @ np.swapaxes(columns, 1, 2)
        return Answer.of(stiffness, k1, covariance, 2 * np.pi * frequency)


class ShiftsFile(Strict):
    """The shift factors that were found, rising in temperature."""

    temperatures: list[Celsius] = Field(min_length=2, max_length=_MOST, description="Mean of each isotherm [degC].")
    log10_a: list[float] = Field(max_length=_MOST, description="log10(aT) [1].")
    covariance_a: list[list[float]] = Field(max_length=_MOST, description="Covariance of log10_a; 0 at the reference.")
    log10_b: list[float] = Field(default_factory=list, max_length=_MOST, description="log10(bT) [1]; []: bT is 1.")
    covariance_b: list[list[float]] = Field(
        default_factory=list, max_length=_MOST, description="Covariance of log10_b; [] if bT is 1."
    )

    band: list[Band] = Field(max_length=_MOST, description="Lowest and highest tested frequency of each isotherm [Hz].")

    def at(self, temperature: float, frequency: FloatArray) -> Shift:
        """The shift to a temperature among the isotherms, for frequencies (N,) [Hz].

        K* there is that of the nearest isotherm which was tested at this place of the master curve, so that what is
        uncertain is the shift from that isotherm only.
        """
        every, decade = np.array(self.temperatures), np.log(10.0)
        kinds = [(np.array(self.log10_a), np.array(self.covariance_a))]
        kinds += [(np.array(self.log10_b), np.array(self.covariance_b))] if self.log10_b else []
        parts = [interpolated(every, values, covariance, temperature) for values, covariance in kinds]
        place = np.log10(np.maximum(frequency, _LEAST))[:, None] + parts[0][0]
        ends = np.log10(self.band) + kinds[0][0][:, None]
        off = np.maximum(np.maximum(ends[:, 0] - place, place - ends[:, 1]), 0.0)
        tested = off <= off.min(axis=1, keepdims=True) + _SAME_PLACE
        nearest = np.argmin(np.where(tested, np.abs(every - temperature), np.inf), axis=1)
        found = [(0.0, np.zeros(frequency.size))] * 2
        for at, ((value, changes, error), (_, covariance)) in enumerate(zip(parts, kinds, strict=True)):
            apart = np.linalg.norm(changes - root_of(covariance)[nearest], axis=1)
            found[at] = decade * value, decade * np.hypot(apart, error)
        (log_a, std_a), (log_b, std_b) = found
        return Shift(log_a, log_b, std_a, std_b)


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

    def at(self, temperature: float, frequency: FloatArray) -> Shift:
        """The shift to a temperature, for frequencies (N,) [Hz].

        Factors are interpolated among the isotherms, and continued from the next one by the law.
        """
        law, slope = self.shift_law, (0.0, 0.0) if self.vertical is None else (self.vertical.slope, self.vertical.std)
        there = self.reference if self.shifts is None else float(np.clip(temperature, *self.range))
        none = np.zeros(frequency.size)
        found = Shift(0.0, 0.0, none, none) if self.shifts is None else self.shifts.at(there, frequency)
        if there == temperature:
            return found
        onward, apart = law.at_reference(there), temperature - there
        return Shift(
            found.log_a + float(onward.log_a(temperature)[0]),
            found.log_b + slope[0] * apart,
            np.hypot(found.std_a, onward.log_a_std(temperature)),
            np.hypot(found.std_b, slope[1] * apart),
            () if self.shifts is None or abs(apart) < _ROUNDED else (self._beyond(law),),
        )

    def _beyond(self, law: ShiftLaw) -> str:
        assert self.shifts is not None
        low, high = self.range
        said = f"beyond the tested {low:.4g} to {high:.4g} °C: by the {self.law} law"
        values, std = np.array(self.shifts.log10_a), np.sqrt(np.diag(np.array(self.shifts.covariance_a)))
        where, miss, u = worst_miss(law, np.array(self.shifts.temperatures), values * _DECADE, std * _DECADE)
        return said if miss <= 2 * u else f"{said}, which misses the shift found at {where:.4g} °C by {_decades(miss)}"


def _decades(log: float) -> str:
    return f"{log / _DECADE:.2g} decades"


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
    if len(shifts.band) != len(temperatures) or any(low > high for low, high in shifts.band):
        raise ModelError(f"{where}: the bands are not those of {len(temperatures)} isotherms: it was changed")
    for values, covariance in ((shifts.log10_a, shifts.covariance_a), (shifts.log10_b, shifts.covariance_b)):
        if values is shifts.log10_b and not values and not covariance:
            continue
        if len(values) != len(temperatures) or max(map(abs, values)) > LARGEST:
            raise ModelError(f"{where}: {len(values)} factors for {len(temperatures)} temperatures: it was changed")
        check_covariance(where, covariance, len(values))
