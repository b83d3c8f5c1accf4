"""The twelve claims of the 1982 paper, read on the result tables of a campaign of its two tyres.

Each is a statement about every condition in common; the text with a verdict gives the narrowest margin.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Key = tuple[float, ...]
Verdict = tuple[bool, str]

# the cam turns at up to 0.3 % from the stated speed, which is a whole or half number of Hz
_SAME_FREQUENCY = 0.006
_EDGE = 1e-6  # for round-off at the ends of a range


@dataclass(frozen=True)
class Tyre:
    """The results of one tyre by (pressure, preload, frequency), K1 and nonlinearity by the first of these."""

    k1: dict[Key, float]
    nonlinearity: dict[Key, float]
    k2: dict[Key, float]
    c: dict[Key, float]
    tr: dict[Key, float]


def evaluate_claims(static: pl.DataFrame, dynamic: pl.DataFrame) -> list[tuple[int, bool, str]]:
    """Evaluate the twelve claims; (number, holds, what was found) for each.

    `static` and `dynamic` are the tables static.csv and dynamic.csv of an analysis. The tyres are told apart
    by "cross" and "radial" in their names. Rejected tests, tests with an added mass and blanks are left out; where a
    claim then has nothing to be read on it does not hold.
    """
    cross, radial = (_tyre(static, dynamic, word) for word in ("cross", "radial"))
    claims: tuple[Callable[[], Verdict], ...] = (
        lambda: _above(cross.k1, radial.k1, "K1 cross-ply / radial-ply"),
        lambda: _claim_2(cross, radial),
        lambda: _claim_3(cross),
        lambda: _rising(radial.c, 0, "C of the radial-ply against pressure"),
        lambda: _claim_5(cross, radial),
        lambda: _rising(radial.c, 2, "C of the radial-ply against frequency"),
        lambda: _above(cross.c, radial.c, "C cross-ply / radial-ply"),
        lambda: _claim_8(radial),
        lambda: _rising(radial.k2, 2, "K2 of the radial-ply against frequency"),
        lambda: _claim_10(cross, radial),
        lambda: _claim_11(cross, radial),
        lambda: _claim_12(cross, radial),
    )
    results = []
    for number, claim in enumerate(claims, start=1):
        try:
            holds, found = claim()
        except (ValueError, ZeroDivisionError) as error:
            holds, found = False, f"nothing to read it on: {error}"
        results.append((number, bool(holds), found))
    return results


def _tyre(static: pl.DataFrame, dynamic: pl.DataFrame, word: str) -> Tyre:
    still = _used(static, word)
    moving = _used(dynamic, word)
    frequency = _grouped(moving["frequency [Hz]"].to_numpy())
    moving = moving.with_columns(pl.Series("group", frequency))
    condition = ["pressure [Pa]", "preload [N]"]
    return Tyre(
        k1=_values(still, condition, "K1 [N/m]"),
        nonlinearity=_values(still, condition[:1], "nonlinearity [1]"),
        k2=_values(moving, [*condition, "group"], "K2 [N/m]"),
        c=_values(moving, [*condition, "group"], "C [N s/m]"),
        tr=_values(moving, [*condition, "group"], "TR measured [1]"),
    )


def _used(table: pl.DataFrame, word: str) -> pl.DataFrame:
    chosen = table.filter(pl.col("tyre").str.to_lowercase().str.contains(word, literal=True))
    if "added mass [kg]" in chosen.columns:  # which moves the resonance
        chosen = chosen.filter(pl.col("added mass [kg]").fill_null(0.0) == 0.0)
    if "verdict" in chosen.columns:
        chosen = chosen.filter(pl.col("verdict") != "rejected")
    return chosen


def _grouped(frequency: FloatArray) -> FloatArray:
    """Each frequency replaced by the nearest half hertz if that is close enough."""
    nearest = np.round(2.0 * frequency) / 2.0
    return np.where(np.abs(frequency / nearest - 1.0) < _SAME_FREQUENCY, nearest, frequency)


def _values(table: pl.DataFrame, keys: list[str], column: str) -> dict[Key, float]:
    """Mean of `column` (in case of repeats) by `keys`, pressure to the nearest 0.1 kPa; blanks left out."""
    kept = table.filter(pl.col(column).is_not_null() & pl.col(column).is_finite())
    kept = kept.with_columns((pl.col("pressure [Pa]") / 100.0).round() * 100.0)
    means = kept.group_by(keys).agg(pl.col(column).mean())
    return {tuple(row[:-1]): row[-1] for row in means.sort(keys).iter_rows()}


def _above(upper: dict[Key, float], lower: dict[Key, float], what: str) -> Verdict:
    ratio = min(upper[key] / lower[key] for key in upper if key in lower)
    return ratio > 1.0, f"{what}: at least {ratio:.3f}"


def _claim_2(cross: Tyre, radial: Tyre) -> Verdict:
    a, b = cross.nonlinearity, radial.nonlinearity
    ratio = min(a[key] / b[key] for key in a if key in b)
    return ratio > 3.0, f"nonlinearity cross-ply / radial-ply: at least {ratio:.2f}, limit 3"


def _claim_3(cross: Tyre) -> Verdict:
    holds, found = True, []
    for preload in _levels(cross.c, 1):
        mean = {p: _mean(cross.c, (p, preload)) for p in _levels(cross.c, 0)}
        top = max(mean, key=lambda p: mean[p])
        others = [p for p in mean if p != top]
        inside = min(mean) < top < max(mean)
        holds &= inside and abs(top - 168e3) <= 12e3
        margin = 1.0 - max(mean[p] for p in others) / mean[top]
        found.append(f"{preload:.0f} N: largest at {top / 1e3:.0f} kPa, by {100 * margin:.1f} %")
    return holds and bool(found), "; ".join(found)


def _claim_5(cross: Tyre, radial: Tyre) -> Verdict:
    holds, found = True, []
    for name, tyre in (("cross-ply", cross), ("radial-ply", radial)):
        loads, pressures = _levels(tyre.c, 1), _levels(tyre.c, 0)
        excess = [
            _mean(tyre.c, (p, loads[0])) / _mean(tyre.c, (p, loads[-1])) - 1.0 for p in (pressures[0], pressures[-1])
        ]
        holds &= excess[1] > 0.03 and abs(excess[0]) < excess[1] / 3.0 and len(loads) > 1
        found.append(f"{name}: {100 * excess[0]:.2f} % at the lowest, {100 * excess[1]:.2f} % at the highest")
    return holds, "; ".join(found)


def _claim_8(tyre: Tyre) -> Verdict:
    slopes = _slopes(tyre.k2, 0)
    holds, found = True, []
    for preload in sorted({key[0] for key in slopes}):
        by_frequency = {key[1]: slope for key, slope in slopes.items() if key[0] == preload}
        low = [s for f, s in by_frequency.items() if f <= 16.0 * (1.0 + _EDGE)]
        high = [s for f, s in by_frequency.items() if f > 19.0 * (1.0 + _EDGE)]
        flat = [s for f, s in by_frequency.items() if 16.5 * (1.0 - _EDGE) <= f <= 18.5 * (1.0 + _EDGE)]
        outside = float(np.mean(np.abs(low + high)))
        share = max(abs(s) for s in flat) / outside
        holds &= max(low) < 0.0 < min(high) and share < 0.5
        found.append(
            f"{preload:.0f} N: 10-16 Hz at most {max(low):.3f}, above 19 Hz at least {min(high):.3f} N/m/Pa, "
            f"between {share:.2f} of the mean outside"
        )
    return holds and bool(found), "; ".join(found)


def _claim_10(cross: Tyre, radial: Tyre) -> Verdict:
    parts = (
        _claim_8(cross),
        _rising(cross.k2, 2, "against frequency"),
        _above(cross.k2, radial.k2, "K2 cross-ply / radial-ply"),
    )
    return all(holds for holds, _ in parts), "; ".join(found for _, found in parts)


def _claim_11(cross: Tyre, radial: Tyre) -> Verdict:
    below, above = [], []
    pressures = _levels(cross.tr, 0)
    for wanted in (100e3, 168e3):
        pressure = min(pressures, key=lambda p: abs(p - wanted))
        for key in cross.tr:
            if key[0] == pressure and key in radial.tr and abs(key[2] - 18.0) > 1.2:
                if key[2] < 18.0:
                    below.append(radial.tr[key] / cross.tr[key])
                else:
                    above.append(cross.tr[key] / radial.tr[key])
    return (
        min(below) > 1.0 and min(above) > 1.0,
        f"TR radial-ply / cross-ply below 18 Hz: at least {min(below):.3f}; inverse above: {min(above):.3f}",
    )


def _claim_12(cross: Tyre, radial: Tyre) -> Verdict:
    gaps = []
    for pressure in _levels(cross.tr, 0):
        for preload in _levels(cross.tr, 1):
            peaks = []
            for tyre in (radial, cross):
                line = {key[2]: tr for key, tr in tyre.tr.items() if key[:2] == (pressure, preload)}
                peaks.append(max(line, key=lambda f: line[f]) if line else np.nan)
            gaps.append(peaks[1] - peaks[0])
    gap = min(gap for gap in gaps if not np.isnan(gap))
    return gap > 0.0, f"resonance of the cross-ply above the radial-ply's by at least {gap:.1f} Hz"


def _rising(values: dict[Key, float], axis: int, what: str) -> Verdict:
    """Straight-line slope along `axis` > 0 at every setting of the others."""
    slopes = _slopes(values, axis)
    relative = min(slopes.values()) / float(np.mean(list(slopes.values())))
    return min(slopes.values()) > 0.0, f"{what}: smallest slope {relative:.2f} of the mean slope"


def _slopes(values: dict[Key, float], axis: int) -> dict[Key, float]:
    lines: dict[Key, list[tuple[float, float]]] = {}
    for key, value in values.items():
        lines.setdefault((*key[:axis], *key[axis + 1 :]), []).append((key[axis], value))
    return {rest: _slope(np.array(points)) for rest, points in lines.items() if len(points) > 1}


def _slope(points: FloatArray) -> float:
    x, y = (points - points.mean(axis=0)).T
    return float(x @ y / (x @ x))


def _levels(values: Iterable[Key], axis: int) -> list[float]:
    levels = sorted({key[axis] for key in values})
    if not levels:
        raise ValueError("no test that was used")
    return levels


def _mean(values: dict[Key, float], condition: Key) -> float:
    """Mean at one pressure and preload over the frequencies that all pressures and preloads have."""
    tested: dict[Key, set[float]] = {}
    for key in values:
        tested.setdefault(key[:2], set()).add(key[2])
    frequencies = set.intersection(*tested.values())
    if condition not in tested or not frequencies:
        raise ValueError(f"no result at {condition[0] / 1e3:.0f} kPa and {condition[1]:.0f} N")
    return float(np.mean([values[(*condition, f)] for f in frequencies]))
