"""Results: the tables of an analysed campaign, as they are in memory or in their folder."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import polars as pl

from fourpole.campaign.modelfile import ModelFile, read_model_file
from fourpole.campaign.tables import (
    BUDGET_COLUMNS,
    DYNAMIC_COLUMNS,
    QUANTILE_COLUMNS,
    RESIDUAL_COLUMNS,
    RIG_COLUMNS,
    STATIC_COLUMNS,
    TEXT_COLUMNS,
)
from fourpole.errors import CampaignError, FileError, FourpoleError, TableError
from fourpole.io.source import read_bytes, sha256_of

__all__ = ["Results", "read_results"]

_MOST_BYTES = 2_000_000_000
_OPTIONAL = {
    "rig": RIG_COLUMNS,
    "residuals": RESIDUAL_COLUMNS,
    "budget": BUDGET_COLUMNS,
    "quantiles": QUANTILE_COLUMNS,
}
_MADE_BY = {"model": "fit", "map": "map"}


@dataclass(frozen=True)
class Results:
    """Tables of an analysed campaign; all that figures and reports need.

    Attributes
    ----------
    static, dynamic : polars.DataFrame
        As in static.csv and dynamic.csv.
    previews : polars.DataFrame
        A few cycles of signal and fit of each recording, as in previews.parquet; empty where there are none.
    record : dict
        study.json: title, settings, what the campaign states, versions, verdicts, assumptions, hashes.
    rig, residuals, budget, quantiles : polars.DataFrame
        As in rig.csv, residuals.csv, budget.csv and quantiles.csv; empty where the analysis had none.
    models, maps : ModelFile or None
        As in model.json and map.json; None where there are none.
    faults : tuple of str
        Why model files that are there are not used.
    """

    static: pl.DataFrame
    dynamic: pl.DataFrame
    previews: pl.DataFrame
    record: dict[str, Any] = field(default_factory=dict)
    rig: pl.DataFrame = field(default_factory=pl.DataFrame)
    residuals: pl.DataFrame = field(default_factory=pl.DataFrame)
    budget: pl.DataFrame = field(default_factory=pl.DataFrame)
    quantiles: pl.DataFrame = field(default_factory=pl.DataFrame)
    models: ModelFile | None = None
    maps: ModelFile | None = None
    faults: tuple[str, ...] = ()


def read_results(folder: str | Path) -> Results:
    """Read what `Study.write` wrote.

    Parameters
    ----------
    folder : path
        A results folder.

    Returns
    -------
    Results
        Without reading any recording.

    Raises
    ------
    CampaignError
        If the folder does not hold the results of an analysis.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CampaignError(f"{folder}: there is no such folder of results")
    dynamic = _table(folder / "dynamic.csv", DYNAMIC_COLUMNS)
    static = _table(folder / "static.csv", STATIC_COLUMNS)
    try:
        record = json.loads(read_bytes(folder / "study.json", max_bytes=_MOST_BYTES))
        if not isinstance(record, dict):
            raise CampaignError("study.json is not one that fourpole wrote: run fourpole analyse again")
        previews = folder / "previews.parquet"
        frame = pl.read_parquet(previews) if previews.is_file() else pl.DataFrame()
    except (FileError, TableError) as error:
        raise CampaignError(f"{error}; name a folder that fourpole analyse wrote") from None
    except (ValueError, pl.exceptions.PolarsError) as error:
        raise CampaignError(f"{folder}: cannot be read ({error}): run fourpole analyse again") from None
    more: dict[str, Any] = {
        name: _table(folder / f"{name}.csv", columns) if (folder / f"{name}.csv").is_file() else pl.DataFrame()
        for name, columns in _OPTIONAL.items()
    }
    found = Results(static, dynamic, frame, record, **more)
    return _with_models(found, folder)


def _with_models(results: Results, folder: Path) -> Results:
    """The results with the model files that were made from them."""
    sha256 = sha256_of(folder / "dynamic.csv", max_bytes=_MOST_BYTES)
    files: dict[str, Any] = {}
    faults = []
    for name, field_name in (("model", "models"), ("map", "maps")):
        path = folder / f"{name}.json"
        try:
            made = read_model_file(path) if path.is_file() else None
        except FourpoleError as error:
            faults.append(f"{error}; left out: run fourpole {_MADE_BY[name]} again")
            continue
        if made is not None and made.provenance.sha256 != sha256:
            faults.append(f"{path.name} is of other results and left out: run fourpole {_MADE_BY[name]} again")
        elif made is not None:
            files[field_name] = made
    return replace(results, faults=tuple(faults), **files)


def _table(path: Path, columns: tuple[str, ...]) -> pl.DataFrame:
    try:
        content = read_bytes(path, max_bytes=_MOST_BYTES)
        names = pl.read_csv(content, n_rows=0, infer_schema=False).columns
        types = {name: pl.Float64 if name in columns and name not in TEXT_COLUMNS else pl.String for name in names}
        frame = pl.read_csv(content, schema=types)
    except (FileError, TableError) as error:
        raise CampaignError(f"{error}; name a folder that fourpole analyse wrote") from None
    except pl.exceptions.PolarsError as error:
        raise CampaignError(f"{path.name}: cannot be read ({error}): run fourpole analyse again") from None
    lacking = [name for name in columns if name not in names]
    if lacking:
        raise CampaignError(f"{path.name}: has no column {lacking[0]!r}: run fourpole analyse again")
    return frame.with_columns(pl.col(name).fill_null("") for name in names if types[name] == pl.String)
