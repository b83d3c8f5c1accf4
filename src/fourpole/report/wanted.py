"""The units in which the words and tables of a report are written, for as long as it is written."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from fourpole.quantities import Quantity, ShownUnits

_UNITS = ContextVar("units of the report", default=ShownUnits())  # noqa: B039  it is frozen


@contextmanager
def in_units(units: ShownUnits) -> Iterator[None]:
    """Inside the context words and tables have these units, afterwards the former ones.

    Examples
    --------
    >>> from fourpole.quantities import PRESSURE
    >>> with in_units(ShownUnits({"Pa": ("kPa", 1e3)})):
    ...     shown_as(PRESSURE).label
    'pressure [kPa]'
    """
    token = _UNITS.set(units)
    try:
        yield
    finally:
        _UNITS.reset(token)


def shown_as(quantity: Quantity) -> Quantity:
    """A quantity with the unit in which it is written now."""
    return _UNITS.get().of(quantity)
