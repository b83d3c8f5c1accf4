"""NumPy files: the arrays of an .npz by their names, and the one array of an .npy.

A vector is called by its name, in an .npy "1"; a field of an array of records by its own name. A matrix gives a channel
per column, counted from 1: `M.3`, in an .npy "3"; one that is wider than long gives a channel per row. Names, units and
times are as `variables` says; points in time become seconds from the first, durations seconds. Pickled objects are
never opened.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from fourpole.errors import TableError
from fourpole.io.formats.tracks import Content, OpenFile, track_format
from fourpole.io.formats.variables import stated, table, tracks_in, words_in
from fourpole.units import shown

_OBJECTS = "holds Python objects, which are never opened"


def _variable(values: Any, name: str) -> Any:
    """An array as numbers, texts, or the fields of its records; None if it is neither."""
    if values.dtype.names and values.ndim == 1:
        return {one: _variable(values[one], name) for one in values.dtype.names if values[one].ndim == 1}
    if values.dtype.kind == "M" and values.size:
        values = values - values[:1]
    if values.dtype.kind == "m" and np.datetime_data(values.dtype)[0] not in ("generic", "Y", "M"):
        return table(values / np.timedelta64(1, "s"), name, unit="s")
    if values.dtype.kind in "US" and values.ndim < 2:
        texts = [one.decode("latin-1") if isinstance(one, bytes) else str(one) for one in values.ravel()]
        return texts if values.ndim else texts[0]
    return table(values, name) if values.dtype.kind in "fiub" else None


class _Stored:
    """Numbers of an archive, which are unpacked when they are wanted."""

    def __init__(self, archive: Any, key: str) -> None:
        with archive.zip.open(f"{key}.npy") as file:
            is_first = np.lib.format.read_magic(file) == (1, 0)
            read = np.lib.format.read_array_header_1_0 if is_first else np.lib.format.read_array_header_2_0
            self.shape, _, self.dtype = read(file)
        self._values = cache(lambda: archive[key])

    def __getitem__(self, places: Any) -> Any:
        return self._values()[places]


def _content(opened: OpenFile) -> Content:
    """The channels of an open file."""
    notes = []
    try:
        loaded = np.load(opened.path, mmap_mode="r", allow_pickle=False)
    except ValueError as error:
        if "Python objects" in str(error):
            raise TableError(f"{opened.name}: {_OBJECTS}; save numbers") from None
        raise
    if isinstance(loaded, np.ndarray):
        found = _variable(loaded, opened.name)
        tracks = tracks_in(found if isinstance(found, dict) else {"": found}, opened.name, ("{}", "{}"))
        named = [replace(one, name=one.name or "1") for one in tracks]
        return Content("NumPy", named, words=lambda: words_in(found) if isinstance(found, dict) else [])
    archive, variables = opened.closing.enter_context(loaded), {}
    members = set(archive.zip.namelist())
    for key in archive.files:
        if f"{key}.npy" not in members:
            notes.append(f"{shown(key)} is no array and was left out")
            continue
        stored = _Stored(archive, key)
        if stored.dtype.hasobject:
            notes.append(f"{shown(key)} {_OBJECTS}")
        else:
            variables[key] = _variable(stored if stored.dtype.kind in "fiub" else archive[key], opened.name)
    tracks = tracks_in(variables, opened.name, (".{}", ".{}"))
    return Content("NumPy", tracks, [*notes, *stated(variables)], words=lambda: words_in(variables))


FORMAT = track_format("npz", "NumPy", (".npz", ".npy"), "a NumPy file", _content)
