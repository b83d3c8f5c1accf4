"""The units in which a campaign wants its results shown, from texts such as "kPa" and "N/mm"."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fourpole import units
from fourpole.campaign.channels import did_you_mean
from fourpole.errors import UnitError
from fourpole.quantities import ShownUnits

#: Kind of quantity by the name that campaign.toml has for it; these are shown in any unit.
_KINDS = {
    "pressure": "pressure",
    "force": "force",
    "stiffness": "stiffness",
    "damping": "damping",
    "deflection": "displacement",
    "velocity": "velocity",
    "mobility": "mobility",
    "angle": "angle",
    "mass": "mass",
    "energy": "energy",
}
_EXAMPLE = 'units = ["kPa", "N/mm"], or units = { pressure = "kPa", stiffness = "N/mm" }'


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
    found: dict[str, str] = {}
    for name, unit in _pairs(raw):
        if name in found:
            raise ValueError(f"{units.shown(found[name])} and {units.shown(unit)} are both units of {name}: keep one")
        found[name] = unit
    return found


def _pairs(raw: Any) -> Iterator[tuple[str, str]]:
    """Name of the kind, and the unit."""
    if isinstance(raw, dict):
        for name, unit in raw.items():
            if name not in _KINDS:
                raise ValueError(f"no kind of quantity {units.shown(name)}{did_you_mean(name, tuple(_KINDS))}")
            try:
                units.unit_scale(_text(unit), _KINDS[name])
            except UnitError as error:
                raise ValueError(f"{name}: {error}") from None
            yield name, _text(unit)
    elif isinstance(raw, list):
        for unit in raw:
            yield _kind_of(_text(unit)), _text(unit)
    else:
        raise ValueError(f"write them as {_EXAMPLE}")


def _text(unit: Any) -> str:
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
    return next(name for name, one in _KINDS.items() if one == kind)


def shown_units(wanted: Any) -> ShownUnits:
    """The units to show, from units by the name of their kind; what is no such unit is left out.

    Examples
    --------
    >>> shown_units({"pressure": "kPa", "stiffness": "N/mm", "colour": "red"}).wanted
    {'Pa': ('kPa', 1000.0), 'N/m': ('N/mm', 1000.0)}
    """
    found: dict[str, tuple[str, float]] = {}
    for name, unit in wanted.items() if isinstance(wanted, dict) else ():
        try:
            ((one, text),) = wanted_units({name: unit}).items()
        except ValueError:
            continue
        kind = _KINDS[one]
        found[units.si_unit(kind)] = text, units.unit_scale(text, kind)
    return ShownUnits(found)
