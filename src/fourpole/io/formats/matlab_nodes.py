"""Variables of a MATLAB file of versions 5 to 7 as nodes, from what scipy has loaded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fourpole.io.formats.variables import LONGEST_TEXT, MOST_TEXTS, Node


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
