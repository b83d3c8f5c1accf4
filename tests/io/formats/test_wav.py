"""WAV: what scipy wrote comes back, and a header that lies is refused."""

from __future__ import annotations

import struct
import wave
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from fourpole.errors import FileError, TableError
from fourpole.io.formats.wav import FORMAT
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request

LIMIT = 10**9


def asked(path: Path, *names: str, group: str = "", most: int = LIMIT) -> Request:
    return Request(path, names, group, path.name, most)


@pytest.fixture
def table() -> np.ndarray:
    return np.random.default_rng(1).uniform(-0.9, 0.9, (1000, 3))


@pytest.mark.parametrize(
    ("kind", "round_off"), [("u1", 2**-7), ("i2", 2**-15), ("i4", 2**-31), ("f4", 1e-6), ("f8", 1e-12)]
)
def test_samples_come_back_to_full_scale_one(tmp_path: Path, table: np.ndarray, kind: str, round_off: float) -> None:
    full = {"u1": 128, "i2": 2**15, "i4": 2**31}.get(kind, 1)
    raw = (np.round(table * full) + (128 if kind == "u1" else 0) if full > 1 else table).astype(kind)
    wavfile.write(tmp_path / "a.wav", 2048, raw)
    assert BEGINS["wav"]((tmp_path / "a.wav").read_bytes()[:4096])
    info = FORMAT.survey(tmp_path / "a.wav", "a.wav", LIMIT)
    assert [(one.name, one.count, one.rate, one.start) for one in info.signals] == [
        (name, 1000, 2048.0, 0.0) for name in "123"
    ]
    assert info.signals[0].duration == pytest.approx(999 / 2048)
    third, first = FORMAT.read(asked(tmp_path / "a.wav", "3", "1"))
    assert (third.name, third.rate, third.unit, third.time) == ("3", 2048.0, None, None)
    assert first.samples.dtype == np.float64
    np.testing.assert_allclose(third.samples, table[:, 2], atol=0.51 * round_off if full > 1 else round_off)
    np.testing.assert_allclose(first.samples, table[:, 0], atol=0.51 * round_off if full > 1 else round_off)


def test_24_bits_and_one_channel(tmp_path: Path) -> None:
    values = np.array([0, 1, -1, 2**23 - 1, -(2**23)])
    with wave.open(str(tmp_path / "a.wav"), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(3)
        file.setframerate(48000)
        file.writeframes(b"".join(int(one).to_bytes(3, "little", signed=True) for one in values))
    (signal,) = FORMAT.read(asked(tmp_path / "a.wav", "1"))
    np.testing.assert_array_equal(signal.samples, values / 2**23)


def written(path: Path, table: np.ndarray) -> bytes:
    wavfile.write(path, 2048, table.astype("f4"))
    return path.read_bytes()


def test_a_channel_that_is_not_there(tmp_path: Path, table: np.ndarray) -> None:
    written(tmp_path / "a.wav", table)
    with pytest.raises(TableError, match=r"a\.wav: there is no channel '4'.* it has 1, 2, 3"):
        FORMAT.read(asked(tmp_path / "a.wav", "4"))
    with pytest.raises(TableError, match="has no groups"):
        FORMAT.read(asked(tmp_path / "a.wav", "1", group="g"))


def test_what_is_cut_short_or_lies_is_refused(tmp_path: Path, table: np.ndarray) -> None:
    whole = written(tmp_path / "a.wav", table)
    size = whole.index(b"data") + 4
    channels = whole.index(b"fmt ") + 10
    wrong = {
        "cut": whole[:-100],
        "no samples": whole[:30],
        "huge": whole[:size] + struct.pack("<I", 0xFFFFFFF0) + whole[size + 4 :],
        "no channels": whole[:channels] + b"\0\0" + whole[channels + 2 :],
        "many": whole[:channels] + b"\xff\xff" + whole[channels + 2 :],
        "compressed": whole[: channels - 2] + b"\x11\0" + whole[channels:],
        "other": b"t,F1\n0,1\n",
    }
    for what, content in wrong.items():
        (tmp_path / "b.wav").write_bytes(content)
        for use in (
            lambda: FORMAT.survey(tmp_path / "b.wav", "b.wav", LIMIT),
            lambda: FORMAT.read(asked(tmp_path / "b.wav", "1")),
        ):
            with pytest.raises(TableError, match=r"^b\.wav: "):
                use()
        assert what


def test_memory_is_asked_for_before_it_is_used(tmp_path: Path, table: np.ndarray) -> None:
    written(tmp_path / "a.wav", np.repeat(table, 10, axis=0))
    with pytest.raises(FileError, match=r"needs .* more than the .* allowed"):
        FORMAT.read(asked(tmp_path / "a.wav", "1", "2", "3", most=200_000))


def test_a_compression_is_called_by_its_name(tmp_path: Path, table: np.ndarray) -> None:
    whole = bytearray(written(tmp_path / "a.wav", table))
    at = whole.index(b"fmt ") + 8
    whole[at : at + 2] = b"\x07\0"
    (tmp_path / "b.wav").write_bytes(whole)
    with pytest.raises(TableError, match=r"compressed \(µ-law\); save it as PCM or float"):
        FORMAT.survey(tmp_path / "b.wav", "b.wav", LIMIT)
