"""A results folder of an analysis, and copies of it to change."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest
from tests.export.vehicle import table as table_of_tyre
from tests.unlisted import unlisted

from fourpole import analyse
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.virtual import RADIAL_PLY, simulate_campaign

Change = Callable[[pl.DataFrame], pl.DataFrame]


@pytest.fixture(scope="session")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One tyre at two pressures and three frequencies, at one pressure with a mass added too."""
    campaign = simulate_campaign(
        tmp_path_factory.mktemp("export"),
        tyres=[RADIAL_PLY],
        pressures=[135e3, 170e3],
        preloads=[1000.0],
        frequencies=[10.0, 17.0, 24.0],
        added_masses=[0.0, 10.0],
        added_mass_at=("radial-ply", 170e3, 1000.0),
    ).folder
    return analyse(campaign, monte_carlo=0).write(campaign / "results")


@pytest.fixture
def results(analysed: Path, tmp_path: Path) -> Path:
    """A copy to change."""
    return shutil.copytree(analysed, tmp_path / "results")


@pytest.fixture
def changed(results: Path) -> Callable[..., Path]:
    """The copy with another dynamic.csv or study.json."""
    return lambda *changes, **record: change_tables(results, *changes, **record)


def change_tables(results: Path, dynamic: Change | None = None, static: Change | None = None, **record: object) -> Path:
    """The folder, of which tables and values of study.json are changed."""
    unlisted(results)
    for name, change in (("dynamic", dynamic), ("static", static)):
        if change is not None:
            file = results / f"{name}.csv"
            change(table(results, name)).write_csv(file)
    if record:
        study = results / "study.json"
        study.write_text(json.dumps(json.loads(study.read_text("utf-8")) | record), "utf-8")
    return results


def table(folder: Path, name: str = "dynamic") -> pl.DataFrame:
    """A table by Python's own reader, not by the one of the package; blank is None."""
    with (folder / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    return pl.DataFrame({title: _cells([row[at] for row in rows]) for at, title in enumerate(head)})


def _cells(texts: list[str]) -> list[float | None] | list[None] | list[str]:
    if not any(texts):
        return [None] * len(texts)
    try:
        return [float(text) if text else None for text in texts]
    except ValueError:
        return texts


def rejected(*names: str) -> Change:
    """The tests rejected, with a reason."""

    def change(frame: pl.DataFrame) -> pl.DataFrame:
        mine = pl.col("test").is_in(names)
        return frame.with_columns(
            pl.when(mine).then(pl.lit("rejected")).otherwise("verdict").alias("verdict"),
            pl.when(mine).then(pl.lit("lift-off: less drive")).otherwise("remarks").alias("remarks"),
        )

    return change


def repeated(frame: pl.DataFrame) -> pl.DataFrame:
    """The first test once more, as D1b with another K2."""
    again = frame[:1].with_columns(pl.lit("D1b").alias("test"), pl.col("K2 [N/m]") * 1.01)
    return pl.concat([frame, again])


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fits and a map of a tyre at three pressures and three preloads."""
    folder = tmp_path_factory.mktemp("files")
    measured = measured_of(table_of_tyre(), std=1e-3)
    model_file(measured, fit_tyres(measured, "zener")).write(folder / "model.json")
    model_file(measured, maps=map_tyres(measured, "zener")).write(folder / "map.json")
    return folder
