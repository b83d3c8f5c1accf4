"""How long the choice of models takes, from the size of a campaign; the same on every machine."""

from __future__ import annotations

#: Time of a choice for few rows [s], and for each further row [s], on one core of a present machine.
_LEAST, _EACH = 0.5, 0.02


def seconds_of_fits(rows: int) -> float:
    """About how long the choice of a model for each tyre takes [s], with K* in this number of rows.

    Examples
    --------
    >>> seconds_of_fits(1000)
    20.5
    """
    return _LEAST + _EACH * rows
