"""Mutated recordings through the readers: each must be read or refused with one clear error, soon and in bounds.

These are the readers of Fourpole's own; a file that a library reads is read in a worker process.

    python fuzz/fuzz_readers.py [--minutes 2] [--reader tydex] [--first N] [--state FILE]

It goes on where it was stopped: the state file holds the number of the next mutation, and every mutation
follows from its number alone. What breaks a reader is kept beside the state file, in a folder `broken`.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import resource
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

import numpy as np

from fourpole.errors import FourpoleError
from fourpole.io.formats import famos, lvm, rpc, text, tydex, wav
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import FileInfo, Format, Request, Signal

MAX_BYTES = 20_000_000
TIME_LIMIT = 2  # seconds of processor time for an input of at most 200 kilobytes
MEMORY_LIMIT = 4_000_000_000
WORDS = [b"**", b"**END", b"**HEADER", b"**MEASURDATA 99999999999", b"**MEASURCHANNELS", b"***End_of_Header***"]
WORDS += [
    b"Channels\t2",
    b"Channels\t999999999",
    b"Samples\t-1",
    b"***Start_Special***",
    b"Delta_X\t0",
    b"Separator\tComma",
]
WORDS += [
    b"1e999",
    b"-1e308",
    b"nan",
    b"1D400",
    b"0x10",
    b"1_0",
    b"\xd9\xa3",
    b"9" * 400,
    b"1" + b"0" * 5000,
    b"\xff\xfe",
]
WORDS += [
    b'"',
    b'""',
    b"\t",
    b";",
    b",",
    b" ",
    b"\n",
    b"\r",
    b"\r\n",
    b"\x00",
    b"\x85",
    b"\xe2\x80\xa8",
    b"!",
    b"#",
    b"%",
]
WORDS += [
    b"01.02.2024 10:00:00,5",
    b"2024-02-30T25:61:61",
    b"23:59:59",
    b"31/12/9999 00:00:00 AM",
    b"[N]",
    b"F1",
    b"F1.2",
]

TYDEX = b"""**HEADER
RELEASE   Release of TYDEX-Format                 1.3
**COMMENTS
! new tyre
**CONSTANTS
INFLPRES  Inflation pressure            bar       2.1
**MEASURCHANNELS
RUNTIME   Running time                  s         0.001     0         0
F1        Vertical force                N         2         0         100
**MEASURDATA 3
         0      1000
         1    1000.5
         2  NOTAVAIL
**MODELPARAMETERS
FNOMIN    Nominal load                  N         4000
**MODELDEFINITION
text
**END
"""
LVM = b"""LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tYes
X_Columns\tMulti
***End_of_Header***\t
\t
Channels\t2\t\t\t
Samples\t3\t\t3\t
X_Dimension\tTime\t\tTime\t
X0\t0.0\t\t0.0\t
Delta_X\t0.001\t\t0.001\t
***End_of_Header***\t\t\t\t
X_Value\tF1\tX_Value\tV1\tComment
0.0\t1.0\t0.0\t2.0
0.001\t1.5\t0.001\t2.5
0.002\t1.0\t0.002\t2.0
"""
TEXTS = [
    b"t [s];F1 [N];V1\n0;1,5;2\n0,001;;-3\n0,002;4,5;1\n",
    b"Logger 7\nSample rate: 2000 Hz\nF1,V1\nN,m/s\n1,2\n3,4\n5,6\n",
    b"Zeit;F1\n01.02.2024 10:00:00,000;1,5\n01.02.2024 10:00:00,500;2,5\n",
    b"time,F1,F1\n2024-02-01T10:00:00.5Z,1,2\n2024-02-01T10:00:01Z,3,4\n",
    b"Zeit  1 - Standardmessrate [s]\tF1\nSensor\tSG\n2,00 ms (500 Hz)\tx\ns\tN\n0\t1,5\n0,002\t2,5\n",
    "Zeit;F1 [µm]\n0;1\n1;2\n".encode("utf-16"),
    b"# t F1 V1\n0 1.5 2\n1e-3 nan -3\n",
]
FAMOS_KEYS = [
    ("CK", b"1,1"),
    ("NO", b"1,5,FAMOS,3,run"),
    ("NL", b"1252,0x407"),
    ("CB", b"1,3,run,0,"),
    ("CG", b"1,1,1"),
    ("CD", b"0.01,1,1,s,0,0,0"),
    ("NT", b" 3,11,2018,21,24,2.5"),
    ("CC", b"1,1"),
    ("CP", b"1,8,8,64,0,0,1,0"),
    ("Cb", b"1,0,1,1,0,32,0,32,1,0.5,0,"),
    ("CR", b"1,2,1,1,1,N"),
    ("CN", b"1,0,0,2,F1,0,"),
    ("CS", b"1," + struct.pack("<4d", 1, -2, 3, 4)),
]
FAMOS = b"|CF,2,1,1;" + b"".join(b"|%s,1,%d,%s;" % (key.encode(), len(said), said) for key, said in FAMOS_KEYS)
WAV = b"RIFF\x34\0\0\0WAVEfmt \x10\0\0\0\1\0\1\0\xe8\3\0\0\xd0\7\0\0\2\0\x10\0data\x10\0\0\0" + bytes(range(16))


RPC_KEYS = {"FORMAT": "BINARY", "NUM_HEADER_BLOCKS": "4", "NUM_PARAMS": "12", "DELTA_T": "1E-3", "CHANNELS": "2"}
RPC_KEYS |= {"PTS_PER_FRAME": "4", "PTS_PER_GROUP": "8", "FRAMES": "3", "DESC.CHAN_1": "F1", "DESC.CHAN_2": "Zeit"}
RPC_KEYS |= {"SCALE.CHAN_1": "0.01", "SCALE.CHAN_2": "1"}
RPC = b"".join(struct.pack("32s96s", *map(str.encode, one)) for one in RPC_KEYS.items()).ljust(2048, b"\0") + bytes(
    range(64)
)

READERS: dict[str, tuple[Format, list[bytes]]] = {
    "tydex": (
        tydex.FORMAT,
        [TYDEX, TYDEX.replace(b"\n", b"\r\n"), TYDEX.replace(b"  ", b"\t"), TYDEX.decode().encode("utf-16")],
    ),
    "lvm": (lvm.FORMAT, [LVM, LVM.replace(b".", b","), LVM + LVM[LVM.index(b"Channels") :]]),
    "text": (text.FORMAT, TEXTS),
    "famos": (famos.FORMAT, [FAMOS]),
    "rpc": (rpc.FORMAT, [RPC]),
    "wav": (wav.FORMAT, [WAV]),
}


class Overdue(BaseException):
    """A reader took longer than it may; no reader can catch it as an error of its own."""


def _overdue(_number: int, _frame: FrameType | None) -> None:
    raise Overdue


def mutated(seed: bytes, chance: random.Random) -> bytes:
    """A seed with a few changes: bytes, words, lines and ends."""
    content = bytearray(seed)
    for _ in range(chance.choice((1, 1, 2, 3, 6, 12))):
        at, end = sorted((chance.randrange(len(content) + 1), chance.randrange(len(content) + 1)))
        end = min(end, at + chance.choice((1, 4, 30, 300)))
        lines = content.split(b"\n")
        line = chance.randrange(len(lines))
        match chance.randrange(9):
            case 0:
                content[at:at] = chance.choice(WORDS)
            case 1:
                content[at:end] = b""
            case 2:
                content[at:end] = bytes(chance.randrange(256) for _ in range(end - at))
            case 3:
                content[at:end] = content[at:end] * chance.choice((2, 3, 50))
            case 4:
                lines.insert(chance.randrange(len(lines)), lines[line])
                content = bytearray(b"\n".join(lines))
            case 5:
                del lines[line]
                content = bytearray(b"\n".join(lines))
            case 6:
                cells = lines[line].split()
                if cells:
                    lines[line] = lines[line].replace(chance.choice(cells), chance.choice(WORDS), 1)
                content = bytearray(b"\n".join(lines))
            case 7:
                content = content[:at] if chance.random() < 0.3 else content
            case 8 if content:
                content[at % len(content)] ^= 1 << chance.randrange(8)
        content = content[:200_000]
    return bytes(content)


def tried(reader: Format, content: bytes, path: Path) -> str:
    """What a reader makes of a content: read, or refused with an error of ours."""
    path.write_bytes(content)
    for begins in BEGINS.values():
        begins(content[:4096])
    said = "refused"
    for names in ((), ("F1",), ("Zeit", "F1"), ("F1.2",)):
        try:
            if not names:
                check_survey(reader.survey(path, path.name, MAX_BYTES))
                continue
            request = Request(path, ("1",) if reader is wav.FORMAT else names, "", path.name, MAX_BYTES)
            signals = reader.read(request)
            check_signals(signals, request.names, finite=reader.blocks is None or reader is text.FORMAT)
            check_blocks(reader, request, signals)
            said = "read"
        except FourpoleError as error:
            if len(str(error)) > 2000 or "\n" in str(error) or not str(error).startswith(path.name):
                raise AssertionError(f"an error of {len(str(error))} characters: {error!s:.300}") from error
    return said


def check_survey(info: FileInfo) -> None:
    for one in info.signals:
        assert one.count >= 0
        assert one.rate is None or (one.rate > 0 and math.isfinite(one.rate))
        assert all(value is None or math.isfinite(value) for value in (one.start, one.duration))
    assert all(note.isprintable() for note in (info.format, *info.notes))


def check_blocks(reader: Format, request: Request, signals: Sequence[Signal]) -> None:
    """The pieces of a recording are the recording."""
    if reader.blocks is None:
        return
    pieces = list(reader.blocks(request, 3))
    for at, one in enumerate(signals):
        np.testing.assert_array_equal(np.concatenate([piece[at].samples for piece in pieces]), one.samples)
        if one.time is not None:
            np.testing.assert_array_equal(np.concatenate([piece[at].time for piece in pieces]), one.time)


def check_signals(signals: Sequence[Signal], names: Sequence[str], *, finite: bool) -> None:
    assert len(signals) == len(names)
    for one in signals:
        assert one.samples.dtype == np.float64
        assert one.samples.ndim == 1
        assert len(one.samples) or not finite
        assert not (finite and np.isinf(one.samples).any())
        assert one.rate is None or (one.rate > 0 and math.isfinite(one.rate))
        assert math.isfinite(one.start)
        assert one.time is None or (len(one.time) == len(one.samples) and not (finite and np.isinf(one.time).any()))


def main() -> int:
    parser = argparse.ArgumentParser(description="Mutated recordings through the readers.")
    parser.add_argument("--minutes", type=float, default=2.0)
    parser.add_argument("--reader", choices=sorted(READERS), action="append")
    parser.add_argument("--first", type=int, default=0, help="number of the first mutation of a new state file")
    parser.add_argument("--state", type=Path, default=Path("fuzz-state/readers.json"))
    asked = parser.parse_args()
    warnings.simplefilter("error")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    asked.state.parent.mkdir(parents=True, exist_ok=True)
    state = json.loads(asked.state.read_text()) if asked.state.exists() else {}
    signal.signal(signal.SIGPROF, _overdue)
    chosen = asked.reader or sorted(READERS)
    until = time.monotonic() + 60 * asked.minutes
    counts: Counter[str] = Counter()
    slowest = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for reader, seeds in READERS.values():  # what is loaded at first use takes longer than an input may
            for seed in seeds:
                tried(reader, seed, Path(folder, "input.dat"))
        while time.monotonic() < until:
            for name in chosen:
                number = state[name] = state.get(name, asked.first - 1) + 1
                reader, seeds = READERS[name]
                chance = random.Random(f"{name} {number}")
                content = mutated(chance.choice(seeds), chance)
                begun = time.process_time()
                signal.setitimer(signal.ITIMER_PROF, TIME_LIMIT)
                try:
                    counts[f"{name}: {tried(reader, content, Path(folder, 'input.dat'))}"] += 1
                except (Exception, Overdue) as error:  # noqa: BLE001 - that is what is looked for
                    counts[f"{name}: broken"] += 1
                    broken = asked.state.parent / "broken"
                    broken.mkdir(exist_ok=True)
                    (broken / f"{name}-{number}").write_bytes(content)
                    print(f"{name} {number}: {type(error).__name__}: {error!s:.300}")
                    print("".join(traceback.format_tb(error.__traceback__)[-2:]))
                finally:
                    signal.setitimer(signal.ITIMER_PROF, 0)
                slowest = max(slowest, time.process_time() - begun)
            if number % 500 == 0:
                asked.state.write_text(json.dumps(state))
    asked.state.write_text(json.dumps(state))
    for what, count in sorted(counts.items()):
        print(f"{what:20} {count}")
    print(f"slowest input: {slowest:.2f} s; mutations so far: {state}")
    return 1 if any("broken" in what for what in counts) else 0


if __name__ == "__main__":
    sys.exit(main())
