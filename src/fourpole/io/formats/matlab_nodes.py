"""Variables of a MATLAB file as nodes, and those of versions 5 to 7 from what scipy has loaded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue
from fourpole.io.formats import hdf5

LONGEST_TEXT = 1000
MOST_TEXTS = 4096


@dataclass(eq=False)
class Node(ByValue):
    """A variable, a field of a struct or a cell."""

    name: str
    kind: str = "other"
    """numbers, text, cells, struct or other."""
    dims: tuple[int, ...] = ()
    value: float | str | None = None
    """The value of a single number or a short text."""
    below: list[Node] = field(default_factory=list)
    samples: NDArray[Any] | None = None
    """The numbers; None in version 7.3."""
    leaf: hdf5.Leaf | None = None
    """The dataset of version 7.3."""

    @property
    def texts(self) -> list[str] | None:
        """The texts of a cell array; None if it has any cell that is no text."""
        found = [one.value for one in self.below if isinstance(one.value, str)]
        return found if self.kind == "cells" and found and len(found) == len(self.below) else None

    @property
    def is_table(self) -> bool:
        """Whether it is a matrix of numbers with several rows and columns."""
        return self.kind == "numbers" and len(self.dims) == 2 and min(self.dims) > 1

    @property
    def is_vector(self) -> bool:
        """Whether it is a single row or column of several numbers."""
        return self.kind == "numbers" and len(self.dims) == 2 and min(self.dims) == 1 and max(self.dims) > 1


def variables_5(content: Mapping[str, Any]) -> list[Node]:
    """The variables that `scipy.io.loadmat` has loaded, in the order of the file."""
    return [_node_5(name, values) for name, values in content.items() if not name.startswith("__")]


def _node_5(name: str, values: Any) -> Node:
    node = Node(name)
    if type(values) is not np.ndarray:  # a sparse matrix, or an object or a function of MATLAB
        return node
    node.dims = values.shape
    if values.dtype.names is not None:
        if values.shape == (1, 1):
            node.kind = "struct"
            node.below = [_node_5(one, values[one][0, 0]) for one in values.dtype.names]
    elif values.dtype.kind == "O":
        node.kind = "cells"
        node.below = [_node_5("", one) for one in values.ravel(order="F")[:MOST_TEXTS]]
    elif values.dtype.kind == "U":
        node.kind = "text"
        if values.size <= 1 and values.dtype.itemsize <= 4 * LONGEST_TEXT:
            node.value = "".join(values.flat).strip()
    elif values.dtype.kind in "fiu":
        node.kind, node.samples = "numbers", values
        node.value = float(values.flat[0]) if values.size == 1 else None
    return node
