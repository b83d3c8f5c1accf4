"""What a campaign states that is allowed, but is probably a slip."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping

import numpy as np

from fourpole import units
from fourpole.campaign.channels import CHANNEL_KINDS
from fourpole.campaign.schema import CampaignFile
from fourpole.errors import UnitError

#: A gain, and a value of the rig, is not known at all beyond this relative standard uncertainty; a phase beyond [rad].
_MOST_RATIO, _MOST_PHASE = 0.5, 0.5
#: Similarity from which a name is that of a known column with a slip of the pen.
_ALIKE = 0.6
#: Values of a rig that are always known roughly; a damping may not be.
_WEIGHED = ("moving_mass", "preload_stiffness")


def doubtful_columns(own: tuple[str, ...], kinds: Mapping[str, str], present: tuple[str, ...]) -> Iterator[str]:
    """Columns of the user's own that were probably meant as known ones.

    Parameters
    ----------
    own : tuple of str
        Heads of the columns that pass through to the results, without the axes of the conditions.
    kinds : mapping of str to str
        Kind of quantity of each known column, by its name.
    present : tuple of str
        Names of the known columns that the table has.
    """
    for head in own:
        name, unit = units.column_unit(head)
        alike = [known for known, kind in kinds.items() if unit is not None and _is_of(unit, kind)]
        near = [known for known in alike if known not in present]
        near = near or difflib.get_close_matches(name, alike, n=1, cutoff=_ALIKE)
        if near:
            best = (difflib.get_close_matches(name, near, n=1, cutoff=0.0) or near)[0]
            yield (
                f"tests.csv: column {units.shown(head)} is taken as one of your own, so the analysis does not use it; "
                f"if '{best} [{unit}]' is meant, rename it"
            )


def _is_of(unit: str, kind: str) -> bool:
    try:
        units.to_si([1.0], unit, kind)
    except UnitError:
        return False
    return True


def doubtful_uncertainties(stated: CampaignFile) -> Iterator[str]:
    """Standard uncertainties so large that another number was probably meant."""
    for role in CHANNEL_KINDS:
        channel = stated.channels.named(role)
        if channel is None:
            continue
        where = f"campaign.toml: channels.{role}"
        if channel.std_gain is not None and channel.std_gain > _MOST_RATIO:
            ratio = channel.std_gain
            likely = f' A number alone is a ratio: if {ratio:g} % is meant, write "{ratio:g} %".' if ratio >= 1 else ""
            yield f"{where}.std_gain is {100 * ratio:g} %, as if the sensor were not calibrated: is that so?{likely}"
        if channel.std_phase is not None and channel.std_phase > _MOST_PHASE:
            yield (
                f"{where}.std_phase is {np.degrees(channel.std_phase):.3g} degrees, as if the sensor were not "
                "calibrated: is that so?"
            )
    for name, rig in stated.all_rigs.items():
        for part in _WEIGHED:
            one = rig.values.get(part)
            if one is not None and abs(one.std) > _MOST_RATIO * abs(one.value) > 0:
                where = f"campaign.toml: {f'rigs.{name}' if name else 'rig'}.{part}"
                yield f"{where} has a standard uncertainty of {100 * one.std / abs(one.value):.3g} % of it: is that so?"
