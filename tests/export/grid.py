"""Reads a NetCDF file by the C library, in a process of its own: beside h5py, the two HDF5 libraries may collide."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Variable:
    """A variable: missing values are masked, texts are objects."""

    dimensions: tuple[str, ...]
    values: np.ndarray
    attributes: dict[str, Any]


@dataclass(frozen=True)
class Grid:
    """A file."""

    dimensions: dict[str, int]
    attributes: dict[str, Any]
    variables: dict[str, Variable]

    def __getitem__(self, name: str) -> Variable:
        return self.variables[name]


def read_grid(path: Path) -> Grid:
    """What the library finds in the file."""
    ran = subprocess.run([sys.executable, __file__, path], capture_output=True, text=True, check=True)
    said = json.loads(ran.stdout)
    return Grid(
        said["dimensions"], said["attributes"], {name: _variable(one) for name, one in said["variables"].items()}
    )


def _variable(said: dict[str, Any]) -> Variable:
    if said["kind"] == "text":
        values = np.array(said["values"], dtype=object)
    else:
        values = np.ma.masked_invalid(np.array(said["values"], dtype=float))
    return Variable(tuple(said["dimensions"]), values.reshape(said["shape"]), said["attributes"])


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _said(variable: Any) -> dict[str, Any]:
    """Numbers by their shortest digits, which name one float only."""
    values = variable[...]
    text = variable.dtype is str
    listed = np.atleast_1d(np.asarray(values, dtype=object)).ravel().tolist()
    if not text:
        listed = np.ma.filled(np.ma.asarray(values, dtype=float), np.nan).ravel().tolist()
    return {
        "kind": "text" if text else "number",
        "dimensions": variable.dimensions,
        "shape": variable.shape,
        "attributes": {name: _plain(variable.getncattr(name)) for name in variable.ncattrs()},
        "values": listed,
    }


def main() -> None:
    """Say as JSON what the file holds."""
    import netCDF4

    with netCDF4.Dataset(sys.argv[1]) as file:
        said = {
            "dimensions": {name: len(one) for name, one in file.dimensions.items()},
            "attributes": {name: _plain(file.getncattr(name)) for name in file.ncattrs()},
            "variables": {name: _said(one) for name, one in file.variables.items()},
        }
    sys.stdout.write(json.dumps(said))


if __name__ == "__main__":
    main()
