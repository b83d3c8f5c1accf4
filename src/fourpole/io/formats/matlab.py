"""MATLAB files, versions 5 to 7 and 7.3: vectors, columns of matrices and fields of structs as channels.

A vector is called as in MATLAB, with the structs that hold it: `F1`, `data.F1`. A matrix gives a channel per column,
counted from 1: `M[:,3]` is MATLAB's M(:,3). A matrix that is wider than long gives a channel per row, `M[3,:]`. A
complex array gives two, `Re K` and `Im K`. Names, units and times are as `variables` says.
Objects, functions and tables of MATLAB are not read.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fourpole.io.formats import hdf5
from fourpole.io.formats.tracks import Content, OpenFile, Track, refused, track_format
from fourpole.io.formats.variables import stated, table, tracks_in, words_in
from fourpole.io.signals import Request

_V73 = b"MATLAB 7.3 MAT-file"
_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_CLASSES = (None, "double", "single", "logical", *_INTEGERS)
_LONGEST_TEXT, _MOST_TEXTS = 1000, 4096


def _fields(content: Iterable[tuple[str, Any]], name: str) -> dict[str, Any]:
    """Variables, or the fields of a struct, as `scipy.io.loadmat` has loaded them."""
    found: dict[str, Any] = {}
    for key, values in content:
        if type(values) is np.ndarray and values.dtype.kind == "c":
            found |= {f"Re {key}": table(values.real, name), f"Im {key}": table(values.imag, name)}
        elif type(values) is np.ndarray:  # others are sparse matrices, objects or functions of MATLAB
            found[key] = _variable(values, name)
    return found


def _variable(values: Any, name: str) -> Any:
    if values.dtype.names is not None:
        one = values[0, 0] if values.shape == (1, 1) else None
        return None if one is None else _fields(zip(values.dtype.names, one, strict=True), name)
    if values.dtype.kind == "O":
        texts = ["".join(one.flat).strip() if _is_text(one) else None for one in values.ravel(order="F")]
        return texts if all(one is not None for one in texts) else None
    if _is_text(values):
        return "".join(values.flat).strip()
    return table(values, name) if values.dtype.kind in "fiu" else None


def _is_text(values: Any) -> bool:
    return type(values) is np.ndarray and values.dtype.kind == "U" and values.size <= 1


class _PartOf:
    """The real or the imaginary part of a dataset of complex numbers."""

    def __init__(self, dataset: Any, part: str) -> None:
        self.shape, self._dataset, self._part = dataset.shape, dataset, part

    def __getitem__(self, places: Any) -> Any:
        return self._dataset[places][self._part]


def _variables_73(h5py: Any, root: Any, every: Iterable[hdf5.Leaf], name: str) -> dict[str, Any]:
    """The variables of a file of version 7.3, which is HDF5, with the fields of structs below them."""
    top: dict[str, Any] = {}
    for leaf in every:
        if leaf.dataset is None or leaf.group.startswith("#") or leaf.name.startswith("#"):
            continue
        place = top
        for part in filter(None, leaf.group.split("/")):
            place = place.setdefault(part, {})
        if leaf.barred == hdf5.NO_NUMBERS and leaf.dataset.dtype.names == ("real", "imag"):
            parts = {f"{key} {leaf.name}": _PartOf(leaf.dataset, of) for key, of in (("Re", "real"), ("Im", "imag"))}
            place |= {key: table(one, name, dims=tuple(reversed(one.shape))) for key, one in parts.items()}
            continue
        place[leaf.name] = _variable_73(h5py, root, leaf.dataset, leaf.barred, name)
    return top


def _variable_73(h5py: Any, root: Any, dataset: Any, barred: str, name: str) -> Any:
    said = hdf5.attributes(dataset)
    kind, short = said.get("MATLAB_class"), dataset.size is not None and dataset.size <= _MOST_TEXTS
    if said.get("MATLAB_empty"):
        return None
    if kind == "char":
        readable = not barred and dataset.size <= _LONGEST_TEXT and min(dataset.shape, default=0) <= 1
        return "".join(chr(int(one)) for one in np.ravel(dataset[()]) if one).strip() if readable else None
    if kind == "cell" and short and h5py.check_ref_dtype(dataset.dtype) is h5py.Reference:
        cells = [root[one] if one else None for one in np.asarray(dataset[()]).T.ravel()]
        known = [one for one in cells if isinstance(one, h5py.Dataset) and not h5py.check_ref_dtype(one.dtype)]
        texts = [_variable_73(h5py, root, one, hdf5.why_barred(h5py, one), name) for one in known]
        return texts if len(texts) == len(cells) and all(isinstance(one, str) for one in texts) else None
    dims = tuple(reversed(dataset.shape)) if not barred and kind in _CLASSES else ()
    return table(dataset, name, dims=(*dims, 1)[: max(len(dims), 2)]) if dims else None


@dataclass(frozen=True)
class _Content(Content):
    """The channels of an open file."""

    def asked(self, request: Request) -> list[Track]:
        """The channels of a request; a column may be written as in MATLAB."""
        names = tuple(re.sub(r"\((:|\d+),(:|\d+)\)$", r"[\1,\2]", one) for one in request.names)
        return super().asked(replace(request, names=names))


def _content(opened: OpenFile) -> Content:
    in_parts = opened.file.read(len(_V73)) == _V73
    opened.file.seek(0)
    closed: list[Track] = []
    if in_parts:
        h5py = opened.load("h5py")
        root = opened.closing.enter_context(h5py.File(opened.file, "r"))
        every = hdf5.leaves(h5py, root, opened.name)
        variables = _variables_73(h5py, root, every, opened.name)
        closed = [one.closed for one in every if one.dataset is None and not one.group]
    else:
        from scipy.io import loadmat

        loaded = loadmat(opened.file, struct_as_record=True)
        variables = _fields(((key, one) for key, one in loaded.items() if not key.startswith("__")), opened.name)
    tracks = tracks_in(variables, opened.name, ("[:,{}]", "[{},:]"))
    form = f"MATLAB {'7.3' if in_parts else '5'}"
    notes = [*refused(closed), *stated(variables)]
    return _Content(form, tracks, notes, closed=closed, words=lambda: words_in(variables))


FORMAT = track_format("matlab", "MATLAB", (".mat",), "a MATLAB file", _content)
