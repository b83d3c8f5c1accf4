"""Faults that the files of a campaign do not mention, put into the folder of a virtual campaign."""

import shutil
from dataclasses import replace

import numpy as np
import polars as pl


def change(folder, column, by, tests=None):
    """Replace the values of a column by a function of them, in all recordings or those of some tests."""
    for path in (folder / "recordings").glob("*.csv"):
        table = pl.read_csv(path)
        if column in table.columns and (tests is None or path.stem in tests):
            table.with_columns(pl.Series(column, by(table[column].to_numpy()))).write_csv(path)


def invert_v2(folder):
    """Give V2 the other sign in all recordings."""
    change(folder, "V2", np.negative)


def drop_out(values):
    """The values (N,) with gaps of zeros in 4 % of them."""
    lost = np.zeros(values.size, dtype=bool)
    for begin in np.random.default_rng(1).integers(values.size, size=values.size // 500):
        lost[begin : begin + 20] = True
    return np.where(lost, 0.0, values)


def copy(folder, source, target):
    """File the recording of one test for another one, too."""
    shutil.copy(folder / "recordings" / f"{source}.csv", folder / "recordings" / f"{target}.csv")


def exchange(folder, one, other):
    """Exchange the recordings of two tests."""
    kept = (folder / "recordings" / f"{one}.csv").read_bytes()
    copy(folder, other, one)
    (folder / "recordings" / f"{other}.csv").write_bytes(kept)


def drifting(tests, share):
    """Planned tests whose tyre becomes stiffer by a share [1] from the first to the last one."""
    last = len(tests) - 1
    return [replace(test, tyre=test.tyre.changed(1.0 + share * at / last)) for at, test in enumerate(tests)]


def scattering(tests, share):
    """Planned tests, whose stiffness and loss differ from one dynamic test to the other by a share [1]."""
    rng = np.random.default_rng(1)

    def own(tyre):
        stiffer, lossier = 1.0 + share * rng.standard_normal(2)
        return tyre.changed(float(stiffer), float(lossier))

    return [test if test.kind == "static" else replace(test, tyre=own(test.tyre)) for test in tests]
