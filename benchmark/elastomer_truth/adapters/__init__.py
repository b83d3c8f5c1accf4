"""Methods by name; each is a function from a campaign's folder to rows of values.csv and causes.csv.

A row of values has test, frequency [Hz], quantity, value, verdict, and lower, upper and u if the method has an
uncertainty. A row of causes has rank, cause, and channel or part; one of rank 0 may have in `said`
what the method says.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

Answer = tuple[list[dict[str, Any]], list[dict[str, Any]]]

#: Module and arguments of each method, and the package that it needs besides numpy, scipy and polars.
METHODS: dict[str, tuple[str, tuple[str, ...], str]] = {
    "paper": ("paper", (), ""),
    "scipy": ("with_scipy", (), ""),
    "pyFRF": ("with_pyfrf", (), "pyFRF"),
    "ISO 10846-3": ("iso10846", (), ""),
    "lmfit": ("with_lmfit", (), "lmfit"),
    "emcee": ("with_emcee", (), "emcee"),
    **{
        f"fourpole {route}": ("with_fourpole", (route,), "fourpole")
        for route in ("joint", "mobility", "relative", "transmissibility")
    },
}


def method(name: str) -> Callable[[Path], Answer]:
    """The method of this name; ImportError if its package is not installed."""
    if name not in METHODS:
        raise ValueError(f"{name}: no such method; methods are {', '.join(METHODS)}")
    module, arguments, package = METHODS[name]
    if package and find_spec(package) is None:
        raise ImportError(f"no package {package}")
    answer = import_module(f"elastomer_truth.adapters.{module}").answer
    return lambda folder: answer(folder, *arguments)
