"""Random tables of text and random fits, by the library in C and by numpy: both must say the same.

    python fuzz/fuzz_kernel.py [--seconds 60] [--first N] [--library PATH]

Each case follows from its number alone. tests/core/test_kernel.py runs it a few seconds, also with a library that is
built with the sanitisers of addresses and of undefined behaviour.
"""

from __future__ import annotations

import argparse
import re
import time

import numpy as np

from fourpole.core import kernel
from fourpole.core.demodulation.sinefit import SineFit, fit_sines, refine
from fourpole.core.demodulation.tracks import Track
from fourpole.io import kernel as loader

#: Numbers that are hard to round, or are none.
HARD = [
    "1e22",
    "1e23",
    "9007199254740993",
    "9007199254740992",
    "0.1e-21",
    "1e-22",
    "4.9e-324",
    "2.2250738585072011e-308",
]
HARD += [
    "1" * 19,
    "1" * 20,
    "1.7976931348623157e308",
    "1e999",
    "nan",
    "inf",
    "-",
    "+",
    ".",
    "1.",
    ".5",
    "-0",
    "1e",
    "1e+",
]
HARD += [
    "0x10",
    "1_0",
    "1e0005",
    "1e-5",
    "5E+3",
    "",
    " 1",
    "1 ",
    "--1",
    "1..2",
    "0." + "0" * 17 + "1",
    "0." + "0" * 25 + "1",
]
PLAIN = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
LENGTHS = [0, 1, 2, 3, 5, 16, 17, 97, 199, 200, 401, 1009, 2000, 4001]
#: Frequency of a line over that of the drive.
LINE = 3.7
SIZES = [0.0, 1e-30, 1e-9, 1.0, 1e9, 1e30]


def decimal(rng: np.random.Generator) -> str:
    """A decimal, mostly a plain one."""
    if rng.random() < 0.02:
        return HARD[rng.integers(len(HARD))]
    value = rng.standard_normal() * 10.0 ** rng.integers(-6, 7)
    return f"{value:.{rng.integers(0, 18 if rng.random() < 0.2 else 9)}{'eEgf'[rng.integers(4)]}}"


def check_cells(rng: np.random.Generator) -> bool:
    """Whether a table was read; what is read is what `float` reads, to the last bit."""
    width, rows = rng.integers(1, 6), rng.integers(0, 12)
    separator, ending = ";,\t"[rng.integers(3)], ("\n", "\r\n", "\r")[rng.integers(3)]
    table = [[decimal(rng) for _ in range(width)] for _ in range(rows)]
    text = bytearray(ending.join(separator.join(row) for row in table).encode())
    if text and rng.random() < 0.3:
        text[rng.integers(len(text))] = rng.integers(256)
    if rows and rng.random() < 0.5:
        text += ending.encode()
    wanted = sorted(rng.choice(width, rng.integers(1, width + 1), replace=False).tolist())
    read = kernel.cells(bytes(text), separator, ending[-1:].encode(), ".", wanted, int(width))
    if read is None:
        return False
    lines = text.decode("latin-1").removesuffix(ending[-1]).split(ending[-1]) if text else []
    cells = [(line.removesuffix("\r") if ending[-1] == "\n" else line).split(separator) for line in lines]
    assert {len(row) for row in cells} <= {width}
    assert all(PLAIN.fullmatch(row[k]) for row in cells for k in wanted)
    expected = np.array([[float(row[k]) for row in cells] for k in wanted]).reshape(len(wanted), -1)
    assert read.tobytes() == expected.tobytes()
    return True


def a_track(rng: np.random.Generator) -> tuple[Track, float]:
    """A track of one to three channels in some memory order, and a frequency near its own [rad/s]."""
    count, channels = LENGTHS[rng.integers(len(LENGTHS))], rng.integers(1, 4)
    rate, cycles = 10.0 ** rng.uniform(0, 4), rng.uniform(3.0, 20.0)
    time_ = (np.arange(count) - 0.5 * (count - 1)) / rate
    omega = 2 * np.pi * cycles * rate / max(count, 1)
    signals = np.cos(omega * time_ + rng.uniform(0, 6, (channels, 1))) + 0.1 * np.cos(2 * omega * time_)
    signals += 10.0 ** rng.uniform(-7, -1) * rng.standard_normal(signals.shape) + 0.05 * np.cos(LINE * omega * time_)
    signals *= SIZES[rng.integers(len(SIZES))]
    if count and rng.random() < 0.05:
        signals[0, rng.integers(count)] = (np.nan, np.inf, -np.inf)[rng.integers(3)]
    order = rng.integers(4)
    if order == 1:
        signals = np.asfortranarray(signals)
    elif order == 2:
        signals = np.repeat(signals, 2, axis=1)[:, ::2]
    elif order == 3:
        signals = signals[:, ::-1].copy()[:, ::-1]
    return Track(("motion_in",) * channels, signals, np.ones(count, dtype=bool), time_, rate), float(omega)


def check_fit(rng: np.random.Generator) -> bool:
    """Whether the library, and not numpy in its place, made a fit."""
    track, omega = a_track(rng)
    harmonics, lines = int(rng.integers(1, 11)), omega * rng.uniform(0.1, 9.0, rng.integers(0, 4))
    unsteady = (2,) if harmonics > 1 and rng.random() < 0.2 else ()
    guess, free = omega * (1 + 1e-3 * rng.standard_normal()), rng.random() < 0.8
    informing, steps = [rng.random(harmonics) < 0.8], track.time.size > 100 and bool(track.energy.all())
    informing[0][0] = True
    if steps:  # a search for lines that are not there goes anywhere
        lines = LINE * omega * (1 + 1e-3 * rng.standard_normal(rng.integers(0, 2)))

    def found() -> tuple[SineFit, float] | str:
        track.__dict__.pop("blocks", None)
        try:
            with np.errstate(all="ignore"):
                fit = fit_sines(track, guess, harmonics, lines, unsteady)
                return (*refine([fit], informing=informing, free=free)[0], 0.0) if steps else (fit, 0.0)
        except (np.linalg.LinAlgError, ValueError, IndexError, ZeroDivisionError) as error:
            return type(error).__name__

    both = []
    for filling in ("numpy", "c"):
        with loader.filled_by(filling):
            both.append(found())
    one, other = both
    if isinstance(one, str) or isinstance(other, str):
        assert all(isinstance(each, str) for each in both), both
        return False
    same(one[0], other[0])
    with loader.filled_by("c"):
        return other[0].rows.fitted() is not None


def same(one: SineFit, other: SineFit) -> None:
    """Assert that amplitudes, frequencies and statistics of two fits are equal but for round-off."""
    size = np.abs(one.coefficients).max(axis=0)
    if not np.isfinite(size).all() or one.dof < 4:
        return
    condition = float(np.linalg.cond(one.inner[: one.size, : one.size]))
    u = np.sqrt(one.variance * np.abs(np.diag(one.inverse))[:, None])
    apart = np.abs(one.coefficients - other.coefficients)
    # beside round-off: the energy that is left has that of the whole energy, and is the weight of each channel
    assert (apart <= 1e-5 * u + (1e-10 + 1e-15 * condition) * size).all(), (apart / u).max()
    np.testing.assert_allclose(one.omega, other.omega, rtol=1e-10)
    np.testing.assert_allclose(
        one.variance, other.variance, rtol=1e-9, atol=1e-13 * condition * one.track.energy.max() / one.dof
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--library", help="a library in place of the one that make kernel builds")
    asked = parser.parse_args()
    if asked.library:
        loader.place = lambda: asked.library
    assert kernel.library() is not None, "no library: run make kernel"
    number, done, end = asked.first, [0, 0], time.monotonic() + asked.seconds
    while time.monotonic() < end:
        for at, check in enumerate((check_cells, check_fit)):
            try:
                done[at] += check(np.random.default_rng([at, number]))
            except BaseException:
                print(f"case {number} of {check.__name__}")
                raise
        number += 1
    print(f"{number - asked.first} cases of each, {done[0]} tables read, {done[1]} fits made: both say the same")
    assert min(done) >= (number - asked.first) // 4, "most are left to others"


if __name__ == "__main__":
    main()
