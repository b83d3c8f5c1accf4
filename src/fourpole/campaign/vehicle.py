"""Vehicles as TOML: quantities with their units, and the vehicles that come with the package."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

from fourpole import units
from fourpole.campaign.channels import did_you_mean, known_keys
from fourpole.errors import CampaignError, ModelError, TableError
from fourpole.io.documents import toml_of
from fourpole.io.door import read_bytes
from fourpole.io.source import decode
from fourpole.ride.vehicle import UNITS, HalfCar, QuarterCar, Vehicle

_FOLDER = Path(__file__).parent / "vehicles"
_LARGEST = 100_000
_KINDS: dict[str, type[QuarterCar] | type[HalfCar]] = {"quarter car": QuarterCar, "half car": HalfCar}
_WORDS = ("name", "source", "kind")
#: Kind of quantity of each unit of a vehicle's values.
_QUANTITIES = {
    "kg": "mass", "kg m²": "inertia", "m": "displacement", "N/m": "stiffness", "N s/m": "damping",
}  # fmt: skip


@dataclass(frozen=True)
class StatedVehicle:
    """A vehicle as it is stated: its name, where its values are from, and its values in SI."""

    name: str
    source: str
    vehicle: Vehicle


@cache
def vehicle_names() -> tuple[str, ...]:
    """Names of the vehicles that come with the package."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))


def vehicle_named(name: str | Path) -> StatedVehicle:
    """The vehicle of a name, or of a file.

    Parameters
    ----------
    name : str or path
        One of `vehicle_names`, or a TOML file.

    Raises
    ------
    CampaignError
        If there is neither, or the file is no vehicle; the message has the key and the remedy.
    FileError
        If the file cannot be read.

    Examples
    --------
    >>> vehicle_named("golden-car").vehicle.suspension_stiffness
    15825.0
    """
    path = Path(name)
    if str(name) in vehicle_names():
        path = _FOLDER / f"{name}.toml"
    elif path.suffix.lower() != ".toml" and not path.is_file():
        there = vehicle_names()
        raise CampaignError(
            f"no vehicle {units.shown(str(name))}{did_you_mean(str(name), there)}; or name a file that ends in .toml"
        )
    content = read_bytes(path, max_bytes=_LARGEST)
    return read_vehicle(decode(content, path.name)[0], path.name)


def read_vehicle(text: str, name: str = "vehicle.toml") -> StatedVehicle:
    r"""The vehicle of a text.

    Parameters
    ----------
    text : str
        TOML with ``kind = "quarter car"`` or ``"half car"`` and a quantity with its unit for each value of the class;
        ``name`` and ``source`` may say what it is.
    name : str
        Name of the file in messages.

    Raises
    ------
    CampaignError
        If a key is unknown or missing, or a value is impossible.

    Examples
    --------
    >>> text = 'kind = "quarter car"\nsprung_mass = "-1 kg"\nunsprung_mass = "40 kg"\n'
    >>> read_vehicle(text + 'suspension_stiffness = "20 kN/m"\nsuspension_damping = "1.5 kN s/m"')
    Traceback (most recent call last):
        ...
    fourpole.errors.CampaignError: vehicle.toml: sprung_mass: -1 kg is not possible: state a value that is positive
    """
    try:
        raw = toml_of(text, name)
    except TableError as error:
        raise CampaignError(str(error)) from None
    try:
        return _stated(raw, Path(name).stem)
    except (ValueError, ModelError) as error:
        raise CampaignError(f"{name}: {error}") from None


def _stated(raw: dict[str, Any], stem: str) -> StatedVehicle:
    """The vehicle of a table; ValueError with the reason if it is none."""
    kind = raw.get("kind")
    if kind not in _KINDS:
        kinds = " or ".join(f'"{known}"' for known in _KINDS)
        raise ValueError(f"kind: {units.shown(str(kind))} is none: write kind = {kinds}")
    made = _KINDS[kind]
    names = [parameter.name for parameter in fields(made)]
    known_keys(raw, (*_WORDS, *names))
    for word in ("name", "source"):
        if not isinstance(raw.get(word, ""), str) or len(raw.get(word, "")) > 1000:
            raise ValueError(f"{word} must be a text of at most 1000 characters")
    values = {}
    for key in names:
        if key not in raw:
            if key == "seat_ahead":
                continue
            raise ValueError(f'{key} is missing: state it with its unit, as {key} = "{_example(key)}"')
        try:
            values[key] = units.quantity(raw[key], _quantity(key))
        except (ValueError, TypeError) as error:
            raise ValueError(f"{key}: {error}") from None
    return StatedVehicle(raw.get("name") or stem, raw.get("source", ""), made(**values))


def _quantity(key: str) -> str:
    return _QUANTITIES[UNITS[key.rpartition("_")[2]]]


def _example(key: str) -> str:
    return {"mass": "250 kg", "inertia": "700 kg m²", "displacement": "1.3 m", "stiffness": "16 kN/m"}.get(
        _quantity(key), "1.5 kN s/m"
    )
