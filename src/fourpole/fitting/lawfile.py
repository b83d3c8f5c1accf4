"""The law of the temperature in a model file: how a master curve answers at another temperature."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from fourpole.errors import ModelError
from fourpole.fitting.modelparts import LARGEST, NamedValue, Strict, check_covariance
from fourpole.models.shift_law import CONSTANTS, ShiftLaw

#: A temperature [degC].
Celsius = Annotated[float, Field(ge=-273.15, le=1e4)]


class VerticalFile(Strict):
    """The vertical shift factor: ln(bT) is proportional to the difference from the reference temperature."""

    slope: float = Field(ge=-1, le=1, description="Slope of ln(bT) over temperature [1/K].")
    std: float = Field(ge=0, le=1, description="[1/K]")


class TemperatureFile(Strict):
    """The law of the shift factors: K*(f, T) = K*(f aT, reference) / bT."""

    law: Literal["WLF", "Arrhenius"] = Field(
        description="WLF: log10 aT = -C1 dT/(C2 + dT), dT = T - reference. Arrhenius: ln aT = E/R (1/T - 1/reference)."
    )
    reference: Celsius = Field(description="Reference temperature of the model [degC].")
    constants: list[NamedValue] = Field(max_length=2, description="C1 [1] and C2 [K], or E [J/mol].")
    covariance: list[list[float]] = Field(max_length=2, description="Covariance of the constants.")
    range: tuple[Celsius, Celsius] = Field(description="Lowest and highest temperature of the isotherms [degC].")
    vertical: VerticalFile | None = Field(default=None, description="null: bT is 1.")
    decided: bool = Field(default=True, description="Whether the shift factors prefer this law to the other.")

    @property
    def shift_law(self) -> ShiftLaw:
        """The law as `models` has it."""
        values = np.array([one.value for one in self.constants], dtype=float)
        covariance = np.array(self.covariance, dtype=float).reshape(values.size, values.size)
        return ShiftLaw(self.law, self.reference, values, covariance)


def check_law(where: str, law: TemperatureFile) -> None:
    """ModelError unless a law of the temperature is consistent."""
    if [(one.name, one.unit) for one in law.constants] != list(CONSTANTS[law.law]):
        named = ", ".join(f"{name} [{unit}]" for name, unit in CONSTANTS[law.law])
        raise ModelError(f"{where}: a law {law.law} has the constants {named}: it was changed")
    if not law.range[0] <= law.reference <= law.range[1]:
        raise ModelError(f"{where}: the reference temperature is outside the range: it was changed")
    if max(abs(one.value) for one in law.constants) > LARGEST:
        raise ModelError(f"{where}: a number is beyond all measure: it was changed")
    check_covariance(where, law.covariance, len(law.constants))
    if law.law == "WLF" and law.constants[1].value + law.range[0] - law.reference <= 0:
        raise ModelError(f"{where}: the WLF law ends within its range, for C2 is too small: it was changed")
