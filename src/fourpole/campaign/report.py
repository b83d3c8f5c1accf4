"""[report] of campaign.toml: what a report says of laboratory, customer, items and method, and the units that it shows.

The items are those of ISO/IEC 17025:2017, 7.8.2.
"""

from __future__ import annotations

import base64
import datetime as dt
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from fourpole import units
from fourpole.campaign.channels import File, did_you_mean
from fourpole.campaign.place import inside
from fourpole.errors import CampaignError, FourpoleError, UnitError
from fourpole.io.door import read_bytes
from fourpole.quantities import FREQUENCY, ShownUnits

#: Characters of one statement, and pieces of equipment.
_MOST_TEXT, _MOST_EQUIPMENT = 600, 60
#: Size of the file of a logo [byte].
_MOST_LOGO = 300_000
#: First bytes of the images that a logo may be, and their kinds.
_IMAGES = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}
#: Kind of quantity by the name that campaign.toml has for it; these are shown in any unit.
_KINDS = {
    **{name: name for name in ("pressure", "force", "stiffness", "damping")},
    "deflection": "displacement",
    **{name: name for name in ("velocity", "mobility", "angle", "mass", "energy")},
}
_EXAMPLE = 'units = ["kPa", "N/mm"], or units = { pressure = "kPa", stiffness = "N/mm" }'


def _text(raw: Any) -> Any:
    """A text without outer blanks; a date of TOML as its text, so that a span of days can be stated as well."""
    if isinstance(raw, dt.date | dt.datetime):
        return raw.isoformat(" ") if isinstance(raw, dt.datetime) else raw.isoformat()
    if not isinstance(raw, str):
        raise ValueError(f"must be a text in quotation marks, not {raw!r}")
    text = raw.strip()
    if len(text) > _MOST_TEXT:
        raise ValueError(f"has {len(text)} characters, at most {_MOST_TEXT} are taken")
    return text


def _frequency(raw: Any) -> float:
    frequency = units.quantity(raw, "frequency")
    if frequency <= 0:
        raise ValueError('must be positive, as "15 Hz"')
    return frequency


Text = Annotated[str, BeforeValidator(_text)]


class Equipment(File):
    """[[report.equipment]]: one instrument with its calibration certificate, and the day until which that holds."""

    name: Text
    serial: Text = ""
    certificate: Text = ""
    due: Text = ""


def wanted_units(raw: Any) -> dict[str, str]:
    """Units by the name of their kind, from a list of units or from a table of them.

    Raises
    ------
    ValueError
        For a unit of no quantity that is shown, two units of one kind, or a kind that is not known.

    Examples
    --------
    >>> wanted_units(["kPa", "N/mm"])
    {'pressure': 'kPa', 'stiffness': 'N/mm'}
    """
    wanted: dict[str, str] = {}
    for name, unit in _pairs(raw):
        if name in wanted:
            raise ValueError(f"{units.shown(wanted[name])} and {units.shown(unit)} are both units of {name}: keep one")
        wanted[name] = unit
    return wanted


def _pairs(raw: Any) -> Iterator[tuple[str, str]]:
    """Name of the kind, and the unit."""
    if isinstance(raw, dict):
        for name, unit in raw.items():
            if name not in _KINDS:
                raise ValueError(f"no kind of quantity {units.shown(name)}{did_you_mean(name, tuple(_KINDS))}")
            try:
                units.unit_scale(_unit_text(unit), _KINDS[name])
            except UnitError as error:
                raise ValueError(f"{name}: {error}") from None
            yield name, _unit_text(unit)
    elif isinstance(raw, list):
        for unit in raw:
            yield _kind_of(_unit_text(unit)), _unit_text(unit)
    else:
        raise ValueError(f"write them as {_EXAMPLE}")


def _unit_text(unit: Any) -> str:
    if not isinstance(unit, str) or not unit.strip():
        raise ValueError(f"{units.shown(str(unit))} is no unit: write them as {_EXAMPLE}")
    return " ".join(unit.split())


def _kind_of(unit: str) -> str:
    """Name of the kind of a unit."""
    try:
        kind, _ = units.channel_scale(unit, tuple(_KINDS.values()))
    except UnitError as error:
        if units.is_unit(unit):
            raise ValueError(
                f"{units.shown(unit)} is a unit of no quantity that can be shown in another one; these are "
                f"{', '.join(_KINDS)}"
            ) from None
        raise ValueError(str(error)) from None
    return next(name for name in _KINDS if _KINDS[name] == kind)


def shown_units(wanted: Any) -> ShownUnits:
    """The units to show, from units by the name of their kind; what is no such unit is left out.

    Examples
    --------
    >>> shown_units({"pressure": "kPa", "stiffness": "N/mm", "colour": "red"}).wanted
    {'Pa': ('kPa', 1000.0), 'N/m': ('N/mm', 1000.0)}
    """
    scales: dict[str, tuple[str, float]] = {}
    for name, unit in wanted.items() if isinstance(wanted, dict) else ():
        try:
            text = wanted_units({name: unit})[name]
        except ValueError:
            continue
        kind = _KINDS[name]
        scales[units.si_unit(kind)] = text, units.unit_scale(text, kind)
    return ShownUnits(scales)


class ReportFile(File):
    """[report]: particulars of the test, all of them optional, and the units to show by the name of their kind.

    `received`, `tested` and `issued` are days, or a text such as "2026-11-02 to 2026-11-05".
    """

    laboratory: Text = ""
    address: Text = ""
    operator: Text = ""
    customer: Text = ""
    number: Text = ""
    replaces: Text = ""
    received: Text = ""
    tested: Text = ""
    issued: Text = ""
    method: Text = ""
    deviations: Text = ""
    environment: Text = ""
    conditioning: Text = ""
    break_in: Text = ""
    sampling: Text = ""
    location: Text = ""
    external: Text = ""
    from_customer: Text = ""
    approved: Text = ""
    logo: Text = ""
    equipment: Annotated[tuple[Equipment, ...], Field(max_length=_MOST_EQUIPMENT)] = ()
    frequency: Annotated[float | None, BeforeValidator(_frequency)] = None
    units: Annotated[dict[str, str], BeforeValidator(wanted_units)] = Field(default_factory=dict)

    @property
    def shown(self) -> ShownUnits:
        """The units to show."""
        return shown_units(self.units)

    def summary(self) -> dict[str, Any]:
        """What is stated, as plain data; the frequency by its head with the unit."""
        stated = self.model_dump(mode="json", exclude_defaults=True)
        if "frequency" in stated:
            stated[FREQUENCY.head] = stated.pop("frequency")
        return stated


def logo_of(folder: Path, file: str) -> str:
    """The image of a file of the campaign as a data: URL; empty without a file.

    Raises
    ------
    CampaignError
        If the file is not there, lies outside the folder, is too large, or is no PNG, JPEG or SVG.
    """
    if not file:
        return ""
    try:
        content = read_bytes(inside(folder, file), max_bytes=_MOST_LOGO, label=file, within=folder)
    except FourpoleError as error:
        raise CampaignError(f"campaign.toml: [report] logo: {error}") from None
    kind = next((kind for start, kind in _IMAGES.items() if content.startswith(start)), "")
    if not kind and b"<svg" in content[:2000]:
        kind = "image/svg+xml"
    if not kind:
        raise CampaignError(f"campaign.toml: [report] logo: {units.shown(file)} is no PNG, JPEG or SVG image")
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
