"""limits.toml: what a customer wants of the results, as lower and upper limits of quantities at conditions."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from fourpole import units
from fourpole.campaign.channels import did_you_mean, known_keys, stated_quantity
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
