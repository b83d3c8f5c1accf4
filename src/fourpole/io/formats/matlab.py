"""MATLAB files, versions 5 to 7 and 7.3: vectors, columns of matrices and fields of structs as channels.

A vector is called as in MATLAB, with the structs that hold it: `F1`, `data.F1`. A matrix gives a channel per column,
counted from 1: `M[:,3]` is MATLAB's M(:,3). A matrix that is wider than long gives a channel per row, `M[3,:]`. A
complex array of versions 5 to 7 gives two, `Re K` and `Im K`. Names, units and times are as `variables` says.
Objects, functions and tables of MATLAB are not read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fourpole.errors import TableError
from fourpole.io.formats import hdf5
from fourpole.io.formats.guard import floats, tidy
from fourpole.io.formats.tracks import OpenFile, Part, Track, track_format
from fourpole.io.formats.variables import LONGEST_TEXT, MOST_TEXTS, Channel, Node, Variables
from fourpole.io.signals import Request
from fourpole.units import shown

_KIND = "a MATLAB file"
_V73 = b"MATLAB 7.3 MAT-file"
_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_CLASSES = (None, "double", "single", "logical", *_INTEGERS)


def _variables_5(content: Mapping[str, Any]) -> list[Node]:
    """The variables that `scipy.io.loadmat` has loaded, in the order of the file."""
    return [node for name, values in content.items() if not name.startswith("__") for node in _nodes_5(name, values)]


def _nodes_5(name: str, values: Any) -> list[Node]:
    """A variable, or the real and the imaginary part of a complex one."""
    if type(values) is np.ndarray and values.dtype.kind == "c":
        return [_node_5(f"Re {name}", values.real), _node_5(f"Im {name}", values.imag)]
    return [_node_5(name, values)]


def _node_5(name: str, values: Any) -> Node:
    node = Node(name)
    if type(values) is not np.ndarray:  # a sparse matrix, or an object or a function of MATLAB
        return node
    node.dims = values.shape
    if values.dtype.names is not None:
        if values.shape == (1, 1):
            node.kind = "struct"
            node.below = [node for one in values.dtype.names for node in _nodes_5(one, values[one][0, 0])]
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


def _variables_73(h5py: Any, root: Any, name: str) -> list[Node]:
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


class _Content(Variables):
    """The channels of an open file."""

    def __init__(self, opened: OpenFile) -> None:
        self.in_parts = opened.file.read(len(_V73)) == _V73
        self.format = f"MATLAB {'7.3' if self.in_parts else '5'}"
        opened.file.seek(0)
        if self.in_parts:
            h5py = opened.guard.load("h5py")
            root = opened.closing.enter_context(h5py.File(opened.file, "r"))
            variables = _variables_73(h5py, root, opened.name)
        else:
            from scipy.io import loadmat

            variables = _variables_5(loadmat(opened.file, struct_as_record=True))
        super().__init__(opened, variables)
        leaves = ((one.name, one.samples) for one in variables if isinstance(one.samples, hdf5.Leaf))
        self._closed = {name: leaf for name, leaf in leaves if leaf.dataset is None}
        """Leaves that cannot be opened, by name."""
        self.notes = [f"{tidy(leaf.path)} {leaf.barred}" for leaf in self._closed.values()]

    def tracks(self, request: Request, *, whole: bool) -> list[Track]:
        """The channels of a request; a column may be written as in MATLAB."""
        names = tuple(re.sub(r"\((:|\d+),(:|\d+)\)$", r"[\1,\2]", one) for one in request.names)
        for name in names:
            if name in self._closed:
                raise TableError(f"{self._name}: channel {shown(name)} {self._closed[name].barred}")
        return super().tracks(replace(request, names=names), whole=whole)

    def reader(self, one: Channel, /) -> Part:
        """The function that reads a part of a channel."""
        node, name = one.node, one.name
        long = node.dims[0] >= node.dims[1]
        table = node.samples
        if table is None:
            raise TableError(f"{self._name}: channel {shown(name)} holds no numbers; name another channel")
        if isinstance(table, hdf5.Leaf):
            # In the file of version 7.3 a matrix is transposed.
            return hdf5.reader(table, self._max_bytes, self._name, row=one.column, axis=0 if long else 1)
        values = table.ravel() if one.column is None else table[:, one.column] if long else table[one.column]
        return lambda first, last: floats(values[first:last], name, self._name)


FORMAT = track_format("matlab", "MATLAB", (".mat",), _KIND, _Content, by_library=True)
