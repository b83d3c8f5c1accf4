"""The rated load of a tyre from its load index."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from fourpole import units
from fourpole.errors import UnitError

#: Load [kg] of the load indices 60 to 139; 80 more stand for ten times the load.
_LOADS = (
    250, 257, 265, 272, 280, 290, 300, 307, 315, 325, 335, 345, 355, 365, 375, 387, 400, 412, 425, 437,
    450, 462, 475, 487, 500, 515, 530, 545, 560, 580, 600, 615, 630, 650, 670, 690, 710, 730, 750, 775,
    800, 825, 850, 875, 900, 925, 950, 975, 1000, 1030, 1060, 1090, 1120, 1150, 1180, 1215, 1250, 1285, 1320, 1360,
    1400, 1450, 1500, 1550, 1600, 1650, 1700, 1750, 1800, 1850, 1900, 1950, 2000, 2060, 2120, 2180, 2240, 2300, 2360,
    2430,
)  # fmt: skip
_FIRST, _DECADE, _HIGHEST = 60, 80, 279
_GRAVITY = 9.80665


def load_of_index(index: int) -> float | None:
    """Load [N] of a load index, times standard gravity; None for an index outside 0 to 279.

    Source: the table of load indices in ISO 4000-1, which repeats ten times larger every 80 indices.

    >>> round(load_of_index(91) / 9.80665), load_of_index(300)
    (615, None)
    """
    if not 0 <= index <= _HIGHEST:
        return None
    decades, at = divmod(index - _FIRST, _DECADE)
    return _LOADS[at] * 10.0**decades * _GRAVITY


def rated_load(stated: Mapping[str, Any]) -> float | None:
    """Rated load [N] of a specimen as campaign.toml states it: `rated_load`, else by `load_index`; None for neither.

    >>> rated_load({"load_index": "91V"}) == load_of_index(91), rated_load({"rated_load": "5 kN"}), rated_load({})
    (True, 5000.0, None)
    """
    if "rated_load" in stated:
        try:
            found = units.quantity(stated["rated_load"], "force")
        except (UnitError, TypeError):
            return None
        return found if found > 0 else None
    index = re.match(r"\s*(\d{1,3})(?!\d)", str(stated.get("load_index", "")))
    return load_of_index(int(index[1])) if index else None
