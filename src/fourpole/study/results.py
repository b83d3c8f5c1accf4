"""The results of a campaign read from their folder, with the models that were made of them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

from fourpole.errors import CampaignError, FileError, FourpoleError, TableError
from fourpole.io.folders import results_in, why_no_folder
from fourpole.io.published import Published, consistently
from fourpole.study.study import Study
from fourpole.study.tables import DYNAMIC, TABLES, read_table

_MADE_BY = {"model": "fit", "map": "map"}


def read_results(folder: str | Path) -> Study:
    """Read what `Study.write` wrote.

    Parameters
    ----------
    folder : path
        A results folder, or the folder of a campaign with its results in `results`.

    Returns
    -------
    Study
        Without reading any recording.

    Raises
    ------
    CampaignError
        If the folder does not hold the results of an analysis.

    Examples
    --------
    >>> read_results("no such folder")
    Traceback (most recent call last):
    ...
    fourpole.errors.CampaignError: no such folder: there is no such folder of results
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CampaignError(why_no_folder(folder) if folder.is_file() else f"{why_no_folder(folder)} of results")
    folder = results_in(folder)
    try:
        return consistently(folder, _read_published)
    except (FileError, TableError) as error:
        raise CampaignError(f"{error}; name a folder that fourpole analyse wrote") from None


def _read_published(files: Published) -> Study:
    tables = {spec.name: read_table(files, spec) for spec in TABLES.values() if spec.read}
    study = Study(record=files.record, tables=tables, files=files)
    return with_models(study, files, files.sha256(f"{DYNAMIC.name}.csv"))


def with_models(results: Study, published: Published, sha256: str, names: Collection[str] = ("model", "map")) -> Study:
    """The results with those model files of a folder that were made of the dynamic.csv of this SHA-256."""
    from fourpole.fitting.modelfile import model_file_of

    files: dict[str, Any] = {}
    faults = []
    for name in names:
        file = f"{name}.json"
        try:
            made = model_file_of(published.read(file), file) if published.has(file) else None
        except FourpoleError as error:
            faults.append(f"{error}; left out: run fourpole {_MADE_BY[name]} again")
            continue
        if made is not None and made.provenance.sha256 != sha256:
            faults.append(f"{file} is of other results and left out: run fourpole {_MADE_BY[name]} again")
        elif made is not None:
            files[f"{name}s"] = made
    return replace(results, faults=tuple(faults), **files)
