"""Variables of a MATLAB file of version 7.3, which is an HDF5 file with transposed matrices."""

from __future__ import annotations

from typing import Any

import numpy as np

from fourpole.io.formats import hdf5
from fourpole.io.formats.variables import LONGEST_TEXT, MOST_TEXTS, Node

_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_CLASSES = (None, "double", "single", "logical", *_INTEGERS)


def variables_73(h5py: Any, root: Any, name: str) -> list[Node]:
    """The variables of a file, with the fields of structs and the cells of arrays below them."""
    top = Node("")
    places = {"": top}
    for leaf in hdf5.leaves(h5py, root, name):
        if leaf.group.startswith("#") or leaf.name.startswith("#"):
            continue
        parent = top
        path = ""
        for part in leaf.group.split("/") if leaf.group else ():
            path = f"{path}/{part}" if path else part
            if path not in places:
                places[path] = Node(part, kind="struct", dims=(1, 1))
                parent.below.append(places[path])
            parent = places[path]
        parent.below.append(_node_73(h5py, root, leaf, name))
    return top.below


def _node_73(h5py: Any, root: Any, leaf: hdf5.Leaf, name: str, *, in_cell: bool = False) -> Node:
    node = Node(leaf.name, samples=leaf)
    dataset = leaf.dataset
    if dataset is None or hdf5.is_elsewhere(h5py, dataset):
        return node
    node.dims = tuple(reversed(dataset.shape or ()))
    if len(node.dims) == 1:
        node.dims = (node.dims[0], 1)
    stated = hdf5.attributes(h5py, dataset)
    kind = stated.get("MATLAB_class")
    if stated.get("MATLAB_empty"):
        return node
    if kind == "char":
        node.kind, node.value = "text", _text_73(dataset, leaf, name)
    elif kind == "cell" and not in_cell and h5py.check_ref_dtype(dataset.dtype) is h5py.Reference:
        node.kind = "cells"
        node.below = _cells_73(h5py, root, dataset, name)
    elif not leaf.barred and kind in _CLASSES:
        node.kind = "numbers"
        if dataset.size == 1:
            node.value = float(hdf5.samples(leaf, 1 << 20, name).ravel()[0])
    return node


def _text_73(dataset: Any, leaf: hdf5.Leaf, name: str) -> str | None:
    if leaf.barred or dataset.size > LONGEST_TEXT or dataset.dtype.kind not in "ui":
        return None
    if min(dataset.shape, default=0) > 1:
        return None
    codes = hdf5.samples(leaf, 1 << 24, name).ravel()
    return "".join(chr(int(code)) for code in codes if 0 < code < 0x110000).strip()


def _cells_73(h5py: Any, root: Any, dataset: Any, name: str) -> list[Node]:
    chunk = np.prod(dataset.chunks or (0,), dtype=object)
    if dataset.size > MOST_TEXTS or chunk > 10 * MOST_TEXTS:
        return []
    below = []
    for reference in np.asarray(dataset[()]).T.ravel():
        target = root[reference] if reference else None
        if isinstance(target, h5py.Dataset):
            below.append(_node_73(h5py, root, hdf5.leaf_of(h5py, target), name, in_cell=True))
        else:
            below.append(Node(""))
    return below
