"""Result tables of designed campaigns: what the tyres do is said by functions, so that each finding is known before."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import polars as pl

from fourpole.study.study import Study
from fourpole.study.tables import DYNAMIC, STATIC

PRESSURES, LOADS, FREQUENCIES = (100e3, 150e3, 200e3, 250e3), (1000.0, 2000.0), (10.0, 13.0, 16.0, 19.0, 22.0)


def rig_curve(resonance: float, damping: float = 0.3) -> Callable[..., float]:
    """TR of a spring with a constant loss factor under a mass."""
    return lambda p, load, f: abs((1 + 1j * damping) / (1 + 1j * damping - (f / resonance) ** 2))


@dataclass
class Tyre:
    """A tyre as its tables shall show it: constants, or functions of pressure, load and frequency."""

    k1: Callable[..., float] | float | None = 100e3
    k2: Callable[..., float] | float | None = 80e3
    c: Callable[..., float] | float | None = 900.0
    loss: Callable[..., float] | float | None = 0.3
    tr: Callable[..., float] | float | None = None
    nonlinearity: float | None = None
    construction: str = ""


@dataclass
class Tables:
    """Result tables of a designed campaign, with noise of each test and the stated uncertainty, both relative."""

    tyres: dict[str, Tyre]
    pressures: tuple[float | None, ...] = PRESSURES
    loads: tuple[float | None, ...] = LOADS
    frequencies: tuple[float, ...] = FREQUENCIES
    u: float = 0.01
    noise: float = 0.0
    seed: int = 0
    verdicts: dict[str, tuple[str, str]] = field(default_factory=dict)
    more: dict[str, object] = field(default_factory=dict)

    def results(self) -> Study:
        rng = np.random.default_rng(self.seed)

        def cell(what, *at):
            value = what(*at) if callable(what) else what
            return None if value is None else value * (1.0 + self.noise * rng.standard_normal())

        def cells(named, *at):
            found = {}
            for column, what in named.items():
                value = cell(what, *at)
                symbol, unit = column.split(" [")
                found |= {column: value, f"u({symbol}) [{unit}": None if value is None else self.u * value}
            return found

        static, dynamic = [], []
        for name, tyre in self.tyres.items():
            for p in self.pressures:
                test = f"S{len({row['test'] for row in static}) + 1}"
                for load in self.loads:
                    row = {"test": test, "tyre": name, "construction": tyre.construction}
                    row |= {"pressure [Pa]": p, "preload [N]": load, "nonlinearity [1]": tyre.nonlinearity}
                    row |= cells({"K1 [N/m]": tyre.k1}, p, load)
                    static.append(row | self._verdict(test))
                    for f in self.frequencies:
                        test_of = f"D{len(dynamic) + 1}"
                        turned = f * (1.0 + 0.003 * rng.uniform(-1, 1))
                        named = {"K2 [N/m]": tyre.k2, "C [N s/m]": tyre.c, "loss factor [1]": tyre.loss}
                        found = cells(named, p, load, f) if tyre.k1 is not None else {}
                        tr = cell(tyre.tr, p, load, turned)
                        found |= {"TR measured [1]": tr, "TR predicted [1]": tr, "u(TR) [1]": tr and self.u * tr}
                        row = {**row, "test": test_of, "frequency [Hz]": turned, "route": "mobility", **self.more}
                        dynamic.append({**row, **found, **self._verdict(test_of)})
        return Study(frame(static, STATIC.columns), frame(dynamic, DYNAMIC.columns), pl.DataFrame())

    def _verdict(self, test: str) -> dict[str, str]:
        verdict, remarks = self.verdicts.get(test, ("ok", ""))
        return {"verdict": verdict, "remarks": remarks}


def frame(rows, columns):
    blank = {name: "" if kind == pl.String else None for name, kind in columns.items()}
    return pl.DataFrame({n: [row.get(n, blank[n]) for row in rows] for n in columns}, columns)
