"""Time until the app shows a long recording: python bench/bench_app.py."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from urllib.request import HTTPCookieProcessor, build_opener, install_opener, urlopen

import h5py
import numpy as np
import polars as pl
from promises import FOURPOLE, at_most, report

from fourpole.io.convert import Choice, convert

SAMPLES, RATE = 10_000_000, 10_000.0
ROUNDS = 5
#: Largest time until the first picture, and of a zoom [s].
FIRST, ZOOM = 2.0, 0.3
STATED = """[unstated]
ordinary = "zero"
[rig]
moving_mass = "15 kg"
preload_stiffness = "12 kN/m"
[channels]
time = { column = "t", unit = "s" }
force_in = { column = "F1", unit = "N" }
motion_in = { column = "V1", unit = "mm/s" }
motion_out = { column = "V2", unit = "mm/s" }
[tyres.a]
"""


def main() -> None:
    lines = []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "long"
        folder.mkdir()
        names = written(folder)
        rows = "".join(f"{name},{file},dynamic,a,2,1000,14.3\n" for name, file in names.items())
        (folder / "campaign.toml").write_text(STATED)
        (folder / "tests.csv").write_text(f"test,file,kind,tyre,pressure [bar],preload [N],frequency [Hz]\n{rows}")
        with serving(Path(place)) as address:
            asked(f"{address}c/long/tests", b"Parquet")
            time.sleep(10)  # somebody reads the list of tests
            for name in names:
                signals = f"{address}c/long/tests/{name}/signals?width=1200"
                first = asked(signals)
                lines.append(at_most(f"first picture, {SAMPLES} samples x 4, {name}", "", first, FIRST, unit="s"))
                spans = [(100.0 * at, 100.0 * at + 10.0**at) for at in range(ROUNDS)]
                found = [asked(f"{signals}&from={low}&to={high}") for low, high in spans]
                detail = f"largest of {ROUNDS} parts; median {median(found):.3f} s"
                lines.append(at_most(f"a part of it, {name}", "", max(found), ZOOM, detail, unit="s"))
    report(lines)


def written(folder: Path) -> dict[str, str]:
    """The same recording in three formats."""
    t = np.arange(SAMPLES) / RATE
    columns = {"t": (t, "s"), "F1": (100 * np.sin(90 * t), "N"), "V1": (np.cos(90 * t), "mm/s")}
    columns["V2"] = (np.cos(90 * t - 0.2), "mm/s")
    frame = pl.DataFrame({f"{name} [{unit}]": values for name, (values, unit) in columns.items()})
    frame.write_parquet(folder / "long.parquet")
    with h5py.File(folder / "long.h5", "w") as file:
        for name, (values, unit) in columns.items():
            file.create_dataset(name, data=values).attrs["unit"] = unit
    convert(folder / "long.parquet", folder / "long.mf4", Choice())
    return {"Parquet": "long.parquet", "HDF5": "long.h5", "MDF": "long.mf4"}


@contextmanager
def serving(root: Path) -> Iterator[str]:
    """The app on a folder, whose token is shown once; what it keeps lies in that folder, too."""
    command, environment = (
        [*FOURPOLE, "app", str(root), "--no-browser"],
        {**os.environ, "XDG_CACHE_HOME": f"{root}/.cache"},
    )
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        try:
            address = process.stdout.readline().removeprefix("app: ").strip()
            install_opener(build_opener(HTTPCookieProcessor()))
            urlopen(address).close()
            yield address.partition("?")[0]
        finally:
            process.terminate()


def asked(address: str, wanted: bytes = b'"channels"') -> float:
    """Time until an answer has what is wanted, asked as the page asks [s]."""
    start = time.perf_counter()
    while True:
        with urlopen(address, timeout=60) as answer:
            if wanted in answer.read():
                return time.perf_counter() - start


if __name__ == "__main__":
    main()
