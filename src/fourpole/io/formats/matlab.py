"""MATLAB files, versions 5 to 7 and 7.3: vectors, columns of matrices and fields of structs as channels.

A vector is called as in MATLAB, with the structs that hold it: `F1`, `data.F1`. A matrix gives a channel per column,
counted from 1: `M[:,3]` is MATLAB's M(:,3). A matrix that is wider than long gives a channel per row, `M[3,:]`. Names,
units and times are as `variables` says. Objects, functions and tables of MATLAB are not read.
"""

from __future__ import annotations

import re
from dataclasses import replace

from fourpole.errors import TableError
from fourpole.io.formats import hdf5
from fourpole.io.formats.guard import floats, tidy
from fourpole.io.formats.matlab_73 import variables_73
from fourpole.io.formats.matlab_nodes import variables_5
from fourpole.io.formats.tracks import OpenFile, Part, Track, track_format
from fourpole.io.formats.variables import Channel, Variables
from fourpole.io.signals import Request
from fourpole.units import shown

_KIND = "a MATLAB file"
_V5, _V73 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"


def _recognises(head: bytes) -> bool:
    return head.startswith((_V5, _V73)) or (
        len(head) >= 128 and head[:6] == b"MATLAB" and head[126:128] in (b"IM", b"MI")
    )


class _Content(Variables):
    """The channels of an open file."""

    def __init__(self, opened: OpenFile) -> None:
        self.in_parts = opened.file.read(len(_V73)) == _V73
        self.format = f"MATLAB {'7.3' if self.in_parts else '5'}"
        opened.file.seek(0)
        if self.in_parts:
            h5py = opened.guard.load("h5py")
            root = opened.closing.enter_context(h5py.File(opened.file, "r"))
            variables = variables_73(h5py, root, opened.name)
        else:
            from scipy.io import loadmat

            variables = variables_5(loadmat(opened.file, struct_as_record=True))
        super().__init__(variables, opened.name, opened.max_bytes)
        leaves = ((one.name, one.samples) for one in variables if isinstance(one.samples, hdf5.Leaf))
        self._closed = {name: leaf for name, leaf in leaves if leaf.dataset is None}
        """Leaves that cannot be opened, by name."""
        self.notes = [f"{tidy(leaf.path)} {leaf.barred}" for leaf in self._closed.values()]

    def tracks(self, request: Request, /, *, whole: bool) -> list[Track]:
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


FORMAT = track_format("MATLAB", (".mat",), _recognises, _KIND, _Content, extra="formats", by_library=True)
