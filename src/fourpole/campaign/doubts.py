"""What a campaign states that is allowed, but is probably a slip."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fourpole import units
from fourpole.campaign.row import QUANTITIES, Column, Test
from fourpole.campaign.schema import CampaignFile

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
