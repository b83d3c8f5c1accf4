"""limits.toml: what a customer wants of the results, as lower and upper limits of quantities at conditions.

The doubts: what a campaign states that is allowed, but is probably a slip.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fourpole import units
from fourpole.campaign.channels import did_you_mean, known_keys, stated_quantity
from fourpole.campaign.row import QUANTITIES, Column, Test
from fourpole.campaign.schema import CampaignFile
from fourpole.errors import CampaignError, TableError, UnitError
from fourpole.io.documents import toml_of

#: Kind of the limits of each quantity, by its key, and the names that limits.toml may use for it.
_QUANTITIES: dict[str, tuple[str, tuple[str, ...]]] = {
    "k1": ("stiffness", ("K1",)),
    "modulus": ("stiffness", ("|K*|", "modulus")),
    "loss_angle": ("angle", ("loss angle", "delta", "δ")),
    "storage": ("stiffness", ("K'", "K′", "storage")),
    "loss": ("stiffness", ("K''", "K″", "loss")),
    "loss_factor": ("ratio", ("loss factor", "tan delta", "tan δ")),
    "k2": ("stiffness", ("K2",)),
    "c": ("damping", ("C",)),
}
_KEYS = {name.casefold(): key for key, (_, names) in _QUANTITIES.items() for name in (key, *names)}
#: The parts of a condition, and their kinds.
_CONDITION = {"pressure": "pressure", "preload": "force", "temperature": "temperature", "frequency": "frequency"}
_FIELDS = ("quantity", "specimen", *_CONDITION, "low", "high")
#: Number of limits of a campaign, and of characters of the name of a specification.
_MOST = 1000
_MOST_TEXT = 200


@dataclass(frozen=True)
class StatedLimit:
    """One limit, in SI.

    Attributes
    ----------
    quantity : str
        Key of the quantity: k1, modulus, loss_angle, storage, loss, loss_factor, k2 or c.
    low, high : float or None
        The limits; None where there is none.
    specimen : str
        The specimen that it holds for; empty for all.
    pressure, preload, temperature, frequency : float or None
        The condition that it holds for, in Pa, N, degC and Hz; None for all.
    """

    quantity: str
    low: float | None = None
    high: float | None = None
    specimen: str = ""
    pressure: float | None = None
    preload: float | None = None
    temperature: float | None = None
    frequency: float | None = None

    def summary(self) -> dict[str, Any]:
        """The limit as plain data, without what it does not state."""
        return {name: value for name, value in asdict(self).items() if value not in (None, "")}


@dataclass(frozen=True)
class Limits:
    """What a customer wants: limits, and the name of the specification that they are from."""

    limits: tuple[StatedLimit, ...] = ()
    specification: str = ""


def read_limits(text: str, specimens: tuple[str, ...], name: str = "limits.toml") -> Limits:
    r"""The limits of a text.

    Parameters
    ----------
    text : str
        Content of limits.toml: ``specification``, if they have a name, and a table ``[[limits]]`` for each limit.
    specimens : tuple of str
        Names of the campaign's specimens.
    name : str
        Name of the file in messages.

    Returns
    -------
    Limits
        In the order of the file.

    Raises
    ------
    CampaignError
        If the text is no valid list of limits; the message has the number of the limit and the remedy.

    Examples
    --------
    >>> read_limits('[[limits]]\nquantity = "K1"\npressure = "2 bar"\nhigh = "220 kN/m"', ()).limits[0].summary()
    {'quantity': 'k1', 'high': 220000.0, 'pressure': 200000.0}
    """
    try:
        raw = toml_of(text, name)
    except TableError as error:
        raise CampaignError(str(error)) from None
    listed, specification = raw.pop("limits", None), raw.pop("specification", "")
    if not isinstance(specification, str) or len(specification) > _MOST_TEXT:
        raise CampaignError(f"{name}: specification must be a text of at most {_MOST_TEXT} characters")
    if raw or not isinstance(listed, list) or not all(isinstance(limit, dict) for limit in listed):
        raise CampaignError(
            f'{name}: write each limit as a table [[limits]] with quantity = "K1" and low or high, as high = "220 kN/m"'
        )
    if len(listed) > _MOST:
        raise CampaignError(f"{name}: has {len(listed)} limits, at most {_MOST} are taken")
    limits = []
    for number, limit in enumerate(listed, start=1):
        try:
            limits.append(_limit(limit, specimens))
        except ValueError as error:
            raise CampaignError(f"{name}: limit {number}: {error}") from None
    return Limits(tuple(limits), specification.strip())


def _limit(raw: dict[str, Any], specimens: tuple[str, ...]) -> StatedLimit:
    """One limit from its table; ValueError with the reason if it is none."""
    known_keys(raw, _FIELDS)
    stated = raw.get("quantity")
    key = _KEYS.get(stated.strip().casefold()) if isinstance(stated, str) else None
    if key is None:
        names = ", ".join(names[0] for _, names in _QUANTITIES.values())
        raise ValueError(f"quantity: {units.shown(stated)} is no quantity with limits; they are {names}")
    specimen = raw.get("specimen", "")
    if not isinstance(specimen, str) or (specimen and specimen not in specimens):
        raise ValueError(f"specimen: no {units.shown(specimen)} in tests.csv{did_you_mean(str(specimen), specimens)}")
    kind = _QUANTITIES[key][0]
    low, high = (_quantity(raw, name, kind) for name in ("low", "high"))
    if low is None and high is None:
        raise ValueError('has neither low nor high: state one of them, as high = "220 kN/m"')
    if low is not None and high is not None and low >= high:
        raise ValueError("low is not below high: exchange them")
    return StatedLimit(key, low, high, specimen, **_condition(raw))


def _condition(raw: dict[str, Any]) -> dict[str, float | None]:
    """The condition of a limit by its axes, in SI; ValueError for a value that no result can have."""
    condition = {name: _quantity(raw, name, kind) for name, kind in _CONDITION.items()}
    for name, value in condition.items():
        if value is not None and value <= 0 and name != "temperature":
            raise ValueError(f"{name}: {units.shown(raw[name])} is not positive, so that no result can have it")
    return condition


def _quantity(raw: dict[str, Any], name: str, kind: str) -> float | None:
    """SI value of a text with its unit; None where it is not stated; ValueError that names it if it is none."""
    try:
        return stated_quantity(raw[name], kind) if name in raw else None
    except UnitError as error:
        raise ValueError(f"{name}: {error}") from None


#: A gain, and a value of the rig, is not known at all beyond this relative standard uncertainty; a phase beyond [rad].
_MOST_RATIO, _MOST_PHASE = 0.5, 0.5
#: Similarity from which a name is that of a known column with a slip of the pen.
_ALIKE = 0.6
#: Least and greatest value, by column, outside which all values of a campaign are probably in another unit [SI].
_PLAUSIBLE = {"pressure": (5e3, 2.5e6), "preload": (5.0, 1e6), "temperature": (0.0, 200.0)}
#: Usual values, by which the unit that was meant is found [SI].
_USUAL = {"pressure": (5e4, 1.5e6), "preload": (50.0, 1e5), "temperature": (-60.0, 150.0)}
#: The units that are tried in place of the stated one.
_MEANT = {"pressure": ("bar", "kPa", "psi"), "preload": ("kN", "N"), "temperature": ("K",)}
#: Values of a rig that are always known roughly; a damping may not be.
_WEIGHED = ("moving_mass", "preload_stiffness")


def doubtful_columns(columns: Sequence[Column], stated: CampaignFile) -> Iterator[str]:
    """Columns of the user's own, but for axes of the conditions, that were probably meant as known ones."""
    axes, present = {axis.name for axis in stated.conditions.axes}, {column.name for column in columns}
    for head in (column.label for column in columns if column.role == "extra" and column.label not in axes):
        name, unit = units.column_unit(head)
        alike = [known for known, (kind, _) in QUANTITIES.items() if unit is not None and units.is_unit(unit, kind)]
        near = [known for known in alike if known not in present]
        near = near or list(filter(None, [units.nearest(name, alike, _ALIKE)]))
        if near:
            best = units.nearest(name, near, 0.0) or near[0]
            yield (
                f"tests.csv: column {units.shown(head)} is taken as one of your own, so the analysis does not use it; "
                f"if '{best} [{unit}]' is meant, rename it"
            )


def doubtful_values(columns: Sequence[Column], tests: Sequence[Test]) -> Iterator[str]:
    """Columns all values of which were probably meant in another unit."""
    for column in columns:
        name, unit = column.name, column.unit
        if column.role != "quantity" or name not in _PLAUSIBLE:
            continue
        low, high = _PLAUSIBLE[name]
        sizes = sorted(abs(value) for test in tests if (value := test.value(name)))
        if not sizes or (sizes[0] <= high and sizes[-1] >= low):
            continue
        # a temperature has another zero in other units, so its numbers are those of the column only in degC
        scale = 1.0 if name == "temperature" else units.unit_scale(unit, column.kind)
        numbers = [size / scale for size in sizes]
        least, most = _USUAL[name]
        meant = (other for other in _MEANT[name] if least <= _as_if(numbers[0], other, column.kind) <= most)
        likely = next(meant, None)
        hint = f"if {likely} is meant, write '{name} [{likely}]'" if likely else "check its unit"
        span = f"{numbers[0]:.4g}" if numbers[0] == numbers[-1] else f"{numbers[0]:.4g} to {numbers[-1]:.4g}"
        yield f"tests.csv: column {units.shown(column.label)} states {span} {unit}: is that so? {hint}"


def _as_if(value: float, unit: str, kind: str) -> float:
    """SI value of a number in another unit."""
    return float(units.to_si([value], unit, kind)[0])


def doubtful_uncertainties(stated: CampaignFile) -> Iterator[str]:
    """Standard uncertainties so large that another number was probably meant; equal ones of channels together."""
    gains: dict[float, list[str]] = {}
    phases: dict[float, list[str]] = {}
    for role, channel in stated.channels.by_role.items():
        if channel.std_gain is not None and channel.std_gain > _MOST_RATIO:
            gains.setdefault(channel.std_gain, []).append(role)
        if channel.std_phase is not None and channel.std_phase > _MOST_PHASE:
            phases.setdefault(channel.std_phase, []).append(role)
    for ratio, roles in gains.items():
        likely = f' A number alone is a ratio: if {ratio:g} % is meant, write "{ratio:g} %".' if ratio >= 1 else ""
        yield (
            f"{_of(roles, 'std_gain')} is {100 * ratio:g} %, as if {_sensors(roles)} not calibrated: "
            f"is that so?{likely}"
        )
    for angle, roles in phases.items():
        yield (
            f"{_of(roles, 'std_phase')} is {np.degrees(angle):.3g} degrees, as if {_sensors(roles)} not calibrated: "
            "is that so?"
        )
    for name, rig in stated.all_rigs.items():
        for part in _WEIGHED:
            weighed = rig.values.get(part)
            if weighed is not None and abs(weighed.std) > _MOST_RATIO * abs(weighed.value) > 0:
                where = f"campaign.toml: {f'rigs.{name}' if name else 'rig'}.{part}"
                percent = 100 * weighed.std / abs(weighed.value)
                yield f"{where} has a standard uncertainty of {percent:.3g} % of it: is that so?"


def _of(roles: Sequence[str], key: str) -> str:
    """A key of some channels in campaign.toml."""
    if len(roles) == 1:
        return f"campaign.toml: channels.{roles[0]}.{key}"
    return f"campaign.toml: [channels] {key} of {', '.join(roles)}"


def _sensors(roles: Sequence[str]) -> str:
    return "the sensor were" if len(roles) == 1 else "the sensors were"
