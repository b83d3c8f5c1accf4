"""imc FAMOS (.dat, .raw), format 2: channels scaled as the file says, evenly spaced or with a time per sample.

A file is a row of keys, `|XX,version,length,content;`. Key CN has the name of a channel, CR its unit, factor and
offset, CP the type of its samples, Cb their place in the file, CD the time step, NT the trigger, and CS the samples.
If channels were triggered at different times, the time zero of the file is the earliest trigger. Single bits of words
are channels of 0 and 1. In a set of two components the second component is the abscissa.

References
----------
imc Meßsysteme, "FAMOS file format", with the keys as the files of imc STUDIO and FAMOS have them.
"""

from __future__ import annotations

import codecs
import datetime as dt
import os
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import of_name, seconds, tidy
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, remembered, track_format
from fourpole.units import shown

_KIND = "an imc FAMOS file"
_LONGEST_KEY = 40
_TYPES = {1: "u1", 2: "i1", 3: "u2", 4: "i2", 5: "u4", 6: "i4", 7: "f4", 8: "f8", 11: "u2", 12: "u8", 14: "i8"}
_SIX_BYTES = 13
_AT_ONCE = 1 << 20


@dataclass
class _Component:
    """The place, type and scaling of the samples of a channel, or of its abscissa."""

    width: int = 0
    kind: int = 0
    index: int = 0
    """Number of the block that holds the samples."""
    begin: int = 0
    size: int = 0
    factor: float = 1.0
    offset: float = 0.0
    unit: str = ""
    start: float = 0.0
    later: float = 0.0
    """Time from the stated trigger to the real one [s]."""
    names: list[tuple[str, int, int, str]] = field(default_factory=list)
    """Name, number of the group, bit (0: the whole word) and comment of each channel."""
    barred: str = ""
    """The reason why it cannot be read; empty if it can."""

    def describe_samples(self, fields: Iterable[int]) -> None:
        """Take the content of the key CP: how the samples are stored."""
        _, width, kind, bits, mask, first, direct, distance = fields
        self.width, self.kind = width, kind
        size = 6 if kind == _SIX_BYTES else np.dtype(_TYPES.get(kind, "V1")).itemsize
        if kind not in (*_TYPES, _SIX_BYTES) or width != size:
            self.barred = f"has samples of the kind {kind}, which are no numbers or not known"
        elif mask or first or distance or direct != 1 or bits != 8 * width:
            self.barred = "is stored between the samples of others; save it again in FAMOS"

    @property
    def count(self) -> int:
        return self.size // self.width if self.width else 0


@dataclass
class _Set:
    """A set of components with its time step and its trigger."""

    components: list[_Component] = field(default_factory=list)
    dimension: int = 1
    step: float = 0.0
    step_unit: str | None = None
    trigger: dt.datetime | None = None
    late: float = 0.0
    """Seconds of the trigger's time of day, with their fraction."""


@dataclass(frozen=True)
class _Channel:
    name: str
    group: str
    bit: int
    note: str
    values: _Component
    owner: _Set
    since: float = 0.0
    """Time from the file's zero to the trigger of the channel [s]."""

    @property
    def abscissa(self) -> _Component | None:
        """The component that has the times of the channel; None if there is none."""
        if len(self.owner.components) != 2 or self.owner.dimension != 2:
            return None
        other = self.owner.components[1]
        return other if other is not self.values and other.unit and seconds(other.unit) is not None else None


def _fields(content: bytes, count: int) -> list[bytes]:
    """The first `count` fields of a key's content."""
    return [one.strip() for one in content.split(b",", count)[:count]]


def _texts(content: bytes, skipped: int, count: int) -> list[bytes]:
    """The texts behind the `skipped` fields of a content; the length of each text stands before it."""
    rest = content.split(b",", skipped)[skipped]
    found = []
    for _ in range(count):
        length, _, rest = rest.partition(b",")
        found.append(rest[: int(length or 0)])
        rest = rest[int(length or 0) + 1 :]
    return found


class _Keys:
    """The channels of an open file, from one pass through its keys."""

    def __init__(self, opened: OpenFile) -> None:
        self._file, self._name = opened.file, opened.name
        self._end = os.fstat(self._file.fileno()).st_size
        self._set = _Set()
        self._sets: list[_Set] = []
        self._groups: dict[int, str] = {}
        self._page = "cp1252"
        self._samples: dict[int, tuple[int, int]] = {}
        """Place and size of each block of samples [byte], by its number."""
        self._order = "<"
        self._notes: list[str] = []
        at = 0
        while at < self._end:
            at = self._key(at)

    def _key(self, at: int) -> int:
        """Read the key at byte `at`; returns where the next key begins."""
        self._file.seek(at)
        head = self._file.read(_LONGEST_KEY)
        blank = len(head) - len(head.lstrip(b"\r\n\t \x00\x1a"))
        if blank:
            return at + blank
        parts = head.split(b",", 3)
        if len(parts) < 4 or len(parts[0]) != 3 or head[:1] != b"|":
            raise TableError(f"{self._name}: is damaged: there is no key at byte {at}; copy or export it again")
        begin = at + len(head) - len(parts[3])
        length = int(parts[2])
        if length < 0 or begin + length + 1 > self._end:
            raise TableError(f"{self._name}: is cut short in the key at byte {at}; copy or export it again")
        self._file.seek(begin)
        kind, version = parts[0][1:], int(parts[1])
        if kind == b"CS":
            index, comma, _ = self._file.read(min(length, _LONGEST_KEY)).partition(b",")
            self._samples[int(index)] = begin + len(index) + len(comma), length - len(index) - len(comma)
        else:
            self._take(kind, version, self._file.read(length))
        self._file.seek(begin + length)
        if self._file.read(1) != b";":
            raise TableError(
                f"{self._name}: is damaged: the key at byte {at} does not end where it says; copy it again"
            )
        return begin + length + 1

    def _take(self, kind: bytes, version: int, content: bytes) -> None:
        """Take a key of the whole file, or else of a set."""
        if kind == b"CF":
            if version != 2:
                raise TableError(f"{self._name}: is of FAMOS format {version}; save it in a newer FAMOS, or as CSV")
            self._order = ">" if _fields(content, 1)[0] == b"2" else "<"
        elif kind == b"NL":
            page = f"cp{_fields(content, 1)[0].decode('ascii', errors='replace')}"
            self._page = page if _is_encoding(page) else self._page
        elif kind == b"NO":
            self._notes += filter(None, (tidy(self._decoded_text(text)) for text in _texts(content, 1, 2)))
        elif kind == b"CB":
            self._groups[int(_fields(content, 1)[0])] = self._decoded_text(_texts(content, 1, 1)[0])
        else:
            self._take_of_set(kind, content)

    def _take_of_set(self, kind: bytes, content: bytes) -> None:
        if kind == b"CG":
            self._set = _Set(dimension=int(_fields(content, 3)[2]))
            self._sets.append(self._set)
        elif kind == b"CD":
            self._set.step = float(_fields(content, 1)[0])
            self._set.step_unit = self._decoded_text(_texts(content, 2, 1)[0]) or None
        elif kind == b"NT":
            self._trigger(content)
        elif kind == b"CC":
            self._set.components.append(_Component())
        elif self._set.components:
            self._describe(self._set.components[-1], kind, content)

    def _decoded_text(self, text: bytes) -> str:
        return text.decode(self._page, errors="replace").strip()

    def _trigger(self, content: bytes) -> None:
        day, month, year, hour, minute, second = _fields(content, 6)
        late = float(second)
        try:
            self._set.trigger = dt.datetime(int(year), int(month), int(day), int(hour), int(minute), tzinfo=dt.UTC)
            self._set.late = late if np.isfinite(late) else 0.0
        except ValueError:
            self._set.trigger = None

    def _describe(self, one: _Component, kind: bytes, content: bytes) -> None:
        if kind == b"CP":
            one.describe_samples(map(int, _fields(content, 8)))
        elif kind == b"Cb":
            count, _, _, index, begin, _, first, size = map(int, _fields(content, 8))
            one.index, one.begin, one.size = index, begin, size
            one.start, one.later = (float(text) for text in _fields(content.split(b",", 9)[9], 2))
            if count != 1 or first:
                one.barred = "is in several parts; save it again in FAMOS, or as CSV"
        elif kind == b"CR":
            transformed, factor, offset = _fields(content, 3)
            if transformed == b"1":
                one.factor, one.offset = float(factor), float(offset)
            one.unit = self._decoded_text(_texts(content, 4, 1)[0])
        elif kind == b"CN":
            group, _, bit = map(int, _fields(content, 3))
            called, comment = map(self._decoded_text, _texts(content, 3, 2))
            one.names.append((called, group, bit, comment))

    def _channels(self) -> list[_Channel]:
        """The channels of the file, in its order."""
        found: list[_Channel] = []
        for owner in self._sets:
            for at, values in enumerate(owner.components):
                if owner.dimension > 2 or (owner.dimension == 2 and len(owner.components) != 2):
                    values.barred = values.barred or "is of several values at a time; export its parts"
                if at and owner.dimension == 2 and not values.names:
                    continue  # the abscissa
                for called, group, bit, comment in values.names or [(f"channel {len(found) + 1}", 0, 0, "")]:
                    found.append(_Channel(called, self._groups.get(group, ""), bit, tidy(comment), values, owner))
        return _since_zero(found)

    def content(self) -> Content:
        """The channels of the file."""
        channels = self._channels()
        triggers = [one.owner.trigger for one in channels]
        began = min((one for one in triggers if one is not None and one.year > 1980), default=None)
        notes = [f"recorded {began.replace(tzinfo=None).isoformat()}"] if began else []
        notes += self._notes[:20]
        return Content("imc FAMOS 2", [*map(self._track, channels)], notes, began.timestamp() if began else None)

    def _track(self, one: _Channel) -> Track:
        values, (rate, start), time = one.values, _timing(one), None
        samples, barred = self._part(values, one.name, one.bit), values.barred
        if one.abscissa is not None:
            scale, times = seconds(one.abscissa.unit) or 1.0, self._part(one.abscissa, one.name, 0)
            time = remembered(lambda first, last: scale * times(first, last) + start)
            if one.abscissa.barred or one.abscissa.count != values.count:
                barred = barred or "has not as many times as values; save it again"
        note, unit = "" if barred else one.note, None if one.bit else of_name(one.name, values.unit)
        return Track(one.name, unit, values.count, samples, rate, start if rate else 0.0, time, one.group, note, barred)

    def _part(self, one: _Component, name: str, bit: int) -> Part:
        """The function that reads a part of the samples of a component."""
        place, held = self._samples.get(one.index, (0, 0))

        def part(first: int, last: int) -> NDArray[np.float64]:
            if one.begin < 0 or one.size < 0 or one.begin + one.size > held:
                what = f"declares {one.size} bytes from byte {one.begin} on, of {held}"
                raise TableError(f"{self._name}: is cut short: channel {shown(name)} {what}; copy it again")
            values = np.empty(last - first)
            for at in range(first, last, _AT_ONCE):
                end = min(at + _AT_ONCE, last)
                self._file.seek(place + one.begin + at * one.width)
                raw = self._decoded(self._file.read((end - at) * one.width), one)
                values[at - first : end - first] = (raw.astype(np.int64) >> (bit - 1)) & 1 if bit else raw
            if one.factor != 1.0 or one.offset:
                values = values * one.factor + one.offset
            return values

        return part

    def _decoded(self, raw: bytes, one: _Component) -> NDArray[np.generic]:
        if one.kind != _SIX_BYTES:
            return np.frombuffer(raw, f"{self._order}{_TYPES[one.kind]}")
        words = np.frombuffer(raw, f"{self._order}u2").reshape(-1, 3).astype(np.uint64)
        low, middle, high = (words[:, at] for at in ((0, 1, 2) if self._order == "<" else (2, 1, 0)))
        return low + (middle << np.uint64(16)) + (high << np.uint64(32))


def _since_zero(channels: list[_Channel]) -> list[_Channel]:
    """The channels, with the time from the earliest trigger to their own if each has one."""
    triggers = [one.owner.trigger for one in channels if one.owner.trigger is not None]
    if not channels or len(triggers) < len(channels):
        return channels
    since = [(trigger - min(triggers)).total_seconds() for trigger in triggers]
    late = [gap + one.owner.late + one.values.later for gap, one in zip(since, channels, strict=True)]
    return [replace(one, since=after - min(late)) for one, after in zip(channels, late, strict=True)]


def _is_encoding(page: str) -> bool:
    try:
        return codecs.lookup(page).name.startswith("cp")
    except LookupError:
        return False


def _timing(one: _Channel) -> tuple[float | None, float]:
    """Rate [Hz] and start [s]; the rate is None if the samples are not even in time."""
    scale = seconds(one.owner.step_unit) if one.owner.step_unit else None
    if one.abscissa is not None or scale is None or one.owner.dimension != 1:
        return None, one.since
    step, start = one.owner.step * scale, one.since + one.values.start * scale
    return (float(f"{1 / step:.15g}"), start) if np.isfinite(start) and 1e-12 < step < 1e12 else (None, one.since)


FORMAT = track_format("famos", "imc FAMOS", (".dat", ".raw"), _KIND, lambda opened: _Keys(opened).content())
