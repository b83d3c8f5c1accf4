"""The verification of results: inputs and tables held against the hashes of study.json, and the analysis run again."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

import polars as pl

from fourpole.campaign.folder import LIMITS, MOST_TESTS, TESTS
from fourpole.campaign.place import inside
from fourpole.errors import CampaignError, FileError, FourpoleError, TableError
from fourpole.fitting.verified import verify
from fourpole.io.door import read_bytes, sha256_of
from fourpole.io.folders import resolved
from fourpole.io.kernel import filled_by
from fourpole.io.published import LIST as NAME
from fourpole.io.published import STORE, published
from fourpole.io.remote import address_of, check_allowed, is_elsewhere
from fourpole.io.seal import KEY, alterations
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.study.analysis import DRAWS, SEED, analyse
from fourpole.study.record import section
from fourpole.study.repeated import Difference, differences, on_limit
from fourpole.study.study import Study
from fourpole.study.tables import LATER, TABLE_FILES, TABLES
from fourpole.version import VERSION
from fourpole.words import first_of

_MODELS = ("model.json", "map.json")
#: Changes of study.json that are named.
_LISTED = 5


class Match(StrEnum):
    """What became of a file since the analysis."""

    SAME = "same"
    CHANGED = "changed"
    MISSING = "missing"
    ADDED = "not of these results"
    ELSEWHERE = "on a server, not fetched"
    UNKNOWN = "without a hash"
    ANEW = "written since, with its own seal"


#: States that say that something is wrong, and those that leave something unknown.
_BAD = (Match.CHANGED, Match.MISSING, Match.ADDED)


@dataclass(frozen=True)
class Proof:
    """A file that was read or written, and its state; `why` says more where there is more to say."""

    name: str
    state: Match
    why: str = ""


@dataclass(frozen=True)
class Repeated:
    """A table of the second run beside the one that was written.

    Attributes
    ----------
    name : str
        Name of the file.
    bits : bool
        Whether both files are the same to the last bit.
    differences : tuple of Difference
        Columns that differ by more than round-off.
    """

    name: str
    bits: bool
    differences: tuple[Difference, ...] = ()


@dataclass(frozen=True)
class VerifiedResults:
    """The outcome of a verification.

    Attributes
    ----------
    folder : Path
    campaign : Path or None
        Folder of the campaign; None if it is not known.
    made_by : str
        Version of Fourpole that wrote the results; empty if study.json does not say.
    commit : str
        Its commit, if it was installed from a repository.
    inputs, results, models : tuple of Proof
        What was read, what was written, and the model files beside it.
    repeated : tuple of Repeated
        Tables of the second run; empty without one.
    not_run : str
        Why there was no second run; empty if there was one.
    quick : bool
        Whether no second run was wanted.
    """

    folder: Path
    campaign: Path | None
    made_by: str
    commit: str
    inputs: tuple[Proof, ...]
    results: tuple[Proof, ...]
    models: tuple[Proof, ...]
    repeated: tuple[Repeated, ...] = ()
    not_run: str = ""
    quick: bool = False

    @property
    def good(self) -> bool:
        """Whether nothing that was checked is wrong; an input that is gone is not wrong, but see `complete`."""
        wrong = any(file.state in _BAD for file in (*self.results, *self.models))
        changed = any(file.state is Match.CHANGED for file in self.inputs)
        return not wrong and not changed and not any(table.differences for table in self.repeated)

    @property
    def complete(self) -> bool:
        """Whether all that was wanted could be checked."""
        return not self.unknown and (self.quick or not self.not_run)

    @property
    def unknown(self) -> tuple[Proof, ...]:
        """The files that could not be checked; a table without a hash is checked by the second run."""
        again = {table.name for table in self.repeated}
        files = (*self.inputs, *(file for file in self.results if file.name not in again), *self.models)
        return tuple(file for file in files if file.state in (Match.MISSING, Match.ELSEWHERE, Match.UNKNOWN))

    @property
    def other_version(self) -> bool:
        """Whether another version of Fourpole wrote the results."""
        return self.made_by != VERSION


def folder_of(path: Path) -> Path | None:
    """The folder of results that a path means by study.json: itself, its `results`, or the file's; None for others."""
    if path.name == NAME and path.is_file():
        return path.parent
    return next((folder for folder in (path, path / "results") if (folder / NAME).is_file()), None)


def verify_results(
    folder: str | Path,
    campaign: str | Path | None = None,
    *,
    quick: bool = False,
    workers: int | None = None,
    further: Callable[[Study], Mapping[str, pl.DataFrame]] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> VerifiedResults:
    """Hold results against the hashes of study.json, and against a second run of the analysis.

    Parameters
    ----------
    folder : path
        The folder with study.json.
    campaign : path, optional
        Folder of the campaign; by default the one that contains `folder`.
    quick : bool
        Whether hashes only are compared.
    workers : int, optional
        As for `analyse`.
    further : callable, optional
        Tables that are written with those of a study, by name.
    progress : callable, optional
        As for `analyse`.

    Returns
    -------
    VerifiedResults
        Nothing is written into the folder.

    Raises
    ------
    CampaignError
        If the folder has no study.json that can be read.
    """
    folder = Path(folder)
    record = _record_of(folder)
    place = _campaign_of(folder, campaign)
    inputs = _inputs(place, record)
    made = section(record, "origin")
    verified = VerifiedResults(
        folder,
        place,
        str(made.get("version") or section(record, "versions").get("fourpole") or ""),
        str(made.get("commit") or ""),
        inputs,
        (*_record(record), *_results(folder, record)),
        tuple(_model(folder, name, _hashes(record, "results")) for name in _MODELS if (folder / name).is_file()),
        not_run=_why_not(place, inputs, quick=quick),
        quick=quick,
    )
    if verified.not_run or place is None:
        return verified
    try:
        repeated = _run_again(folder, place, record, workers, further, progress)
    except FourpoleError as error:
        return replace(verified, not_run=f"the second run ended with an error: {error}")
    return replace(verified, repeated=repeated)


def _record_of(folder: Path) -> Mapping[str, Any]:
    """study.json of results; CampaignError if it is not there or cannot be read, or if no table can be checked."""
    again = "run fourpole analyse again"
    if not os.path.lexists(folder / NAME):
        raise CampaignError(f"{folder}: the results are not complete, {NAME} is not there: {again}")
    try:
        record = published(folder).record
    except (FileError, TableError, ValueError) as error:
        raise CampaignError(f"{folder / NAME}: cannot be read ({error}): {again}") from None
    if not (folder / "dynamic.csv").is_file() and not _hashes(record, "results"):
        raise CampaignError(f"{folder}: the results are not complete, dynamic.csv is not there: {again}")
    return record


def _campaign_of(folder: Path, campaign: str | Path | None) -> Path | None:
    """The folder of the campaign; CampaignError if one is named that is none."""
    if campaign is not None:
        if not (Path(campaign) / "campaign.toml").is_file():
            raise CampaignError(f"{campaign}: no campaign: name the folder with campaign.toml and tests.csv")
        return Path(campaign)
    above = resolved(folder).parent
    return above if (above / "campaign.toml").is_file() else None


#: Size [byte] up to which a result of another size is read, because it may be one of the results before.
_HASHED = 100_000_000


def _hashes(record: Mapping[str, Any], key: str) -> dict[str, str]:
    """Hashes by name of a file, as study.json has them."""
    return {name: sha for name, sha in section(record, key).items() if isinstance(sha, str)}


def _inputs(campaign: Path | None, record: Mapping[str, Any]) -> tuple[Proof, ...]:
    """Each file that the analysis read."""
    stated = _hashes(record, "sha256")
    if campaign is None:
        return tuple(Proof(name, Match.MISSING, "the campaign is not known") for name in stated)
    return tuple(_input(campaign, name, sha) for name, sha in stated.items())


def _input(campaign: Path, name: str, sha: str) -> Proof:
    if is_elsewhere(name):
        return Proof(name, Match.ELSEWHERE)
    try:
        path = inside(campaign, name)
        if not path.exists():
            return Proof(name, Match.MISSING)
        most = MOST_TESTS if name in ("campaign.toml", *TESTS, LIMITS) else MAX_FILE_BYTES
        return Proof(name, Match.SAME if sha256_of(path, max_bytes=most) == sha else Match.CHANGED)
    except TableError:  # an empty file
        return Proof(name, Match.CHANGED, "is empty")
    except FileError as error:
        return Proof(name, Match.MISSING, str(error))


def _record(record: Mapping[str, Any]) -> tuple[Proof, ...]:
    """study.json itself, by its seal, which those of older versions have not."""
    if KEY not in record and "sizes" not in record:
        return ()
    changed = alterations(record)
    return (Proof(NAME, Match.CHANGED, first_of(changed, _LISTED, "; ")) if changed else Proof(NAME, Match.SAME),)


def _results(folder: Path, record: Mapping[str, Any]) -> tuple[Proof, ...]:
    """Each table that was written, and tables that were not."""
    stated = _hashes(record, "results")
    if not stated:
        return tuple(Proof(name, Match.UNKNOWN) for name in TABLE_FILES if (folder / name).is_file())
    # a model file that is there has a line of its own, by its seal
    mine = {name: sha for name, sha in stated.items() if name not in _MODELS or not (folder / name).is_file()}
    sizes = section(record, "sizes")
    written = [_result(folder, name, sha, sizes.get(name)) for name, sha in mine.items() if Path(name).name == name]
    added = [name for name in TABLE_FILES if name not in stated and (folder / name).exists()]
    return (*written, *(Proof(name, Match.ADDED) for name in added))


def _result(folder: Path, name: str, sha: str, size: Any = None) -> Proof:
    """Whether a table is as written; one of another size, which may be huge, is not read."""
    path = folder / name
    if not path.is_file():
        return Proof(name, Match.MISSING)
    if isinstance(size, int) and path.stat().st_size > max(size, _HASHED):
        return Proof(name, Match.CHANGED)
    try:
        there = sha256_of(path, max_bytes=MAX_FILE_BYTES)
    except (FileError, TableError) as error:
        return Proof(name, Match.CHANGED, str(error))
    if there == sha:
        return Proof(name, Match.SAME)
    former = (folder / STORE / there).is_file() and (folder / STORE / sha).is_file()
    return Proof(name, Match.CHANGED, "is of the results before, whose renewal was stopped" if former else "")


def _model(folder: Path, name: str, stated: Mapping[str, str]) -> Proof:
    """A model file, by its own seal and the hash of its table; fit and map may have written it after the analysis."""
    try:
        origin = verify(folder / name).file.provenance
        table = stated.get("dynamic.csv") or sha256_of(folder / "dynamic.csv", max_bytes=MAX_FILE_BYTES)
        same = sha256_of(folder / name, max_bytes=MAX_FILE_BYTES) == stated.get(name)
    except FourpoleError as error:
        return Proof(name, Match.CHANGED, str(error))
    if origin.sha256 != table:
        return Proof(name, Match.ADDED, "is of another dynamic.csv")
    return Proof(name, Match.SAME if same or not stated else Match.ANEW)


def _why_not(campaign: Path | None, inputs: tuple[Proof, ...], *, quick: bool) -> str:
    """Why the analysis is not run again; empty if it is."""
    if quick:
        return "hashes only, as wanted"
    if campaign is None:
        return "the campaign is not known: name its folder with --campaign"
    names = {state: [file.name for file in inputs if file.state is state] for state in Match}
    for name in names[Match.ELSEWHERE]:
        try:
            check_allowed(address_of(name))
        except FileError as error:
            return str(error)
    words = ((Match.CHANGED, "has changed", "have changed"), (Match.MISSING, "is not there", "are not there"))
    for state, single, many in words:
        if wrong := names[state]:
            return f"{wrong[0]} {single}" if len(wrong) == 1 else f"{len(wrong)} inputs {many}, as {wrong[0]}"
    return "" if inputs else f"{NAME} names no file that was read"


def _run_again(
    folder: Path,
    campaign: Path,
    record: Mapping[str, Any],
    workers: int | None,
    further: Callable[[Study], Mapping[str, pl.DataFrame]] | None,
    progress: Callable[[int, int], None] | None,
) -> tuple[Repeated, ...]:
    """Each table of a second run beside the one that was written, in a folder that is deleted."""
    settings = section(record, "settings")
    draws, seed = settings.get("monte_carlo"), settings.get("seed")
    with filled_by(str(record.get("kernel") or "")):
        study = analyse(
            campaign,
            route=str(settings.get("route") or "joint"),
            monte_carlo=draws if isinstance(draws, int) else DRAWS,
            seed=seed if isinstance(seed, int) else SEED,
            workers=workers,
            progress=progress,
        )
    with tempfile.TemporaryDirectory(prefix="fourpole-verify-") as place:
        new = study.write(place, further(study) if further is not None else None)
        names = [*TABLE_FILES, "findings.csv"]
        loose = on_limit(study.tables["checks"])
        return tuple(_repeated(folder, new, name, loose) for name in names if (folder / name).is_file())


def _repeated(former: Path, new: Path, name: str, loose: Collection[str]) -> Repeated:
    """One table of both runs."""
    if not (new / name).is_file():
        gone = Difference("", "", 0, "a table", "no such table", float("nan"), float("inf"))
        return Repeated(name, False, (gone,))
    spec = TABLES.get(Path(name).stem)
    key = spec.key if spec is not None else ()  # findings stand in their order
    try:
        was, now = (read_bytes(folder / name, max_bytes=MAX_FILE_BYTES, within=folder) for folder in (former, new))
        if was == now:
            return Repeated(name, True)
        # The cells of a CSV file are texts, so that a text in place of a number is one cell that differs.
        packed = name.endswith(".parquet")
        tables = [pl.read_parquet(part) if packed else pl.read_csv(part, infer_schema=False) for part in (was, now)]
    except (pl.exceptions.PolarsError, OSError, TableError) as error:
        unread = Difference("", "", 0, f"cannot be read: {error}", "a table", float("nan"), float("inf"))
        return Repeated(name, False, (unread,))
    later = [column for column in LATER if column not in tables[0].columns]
    return Repeated(name, False, tuple(differences(tables[0], tables[1].drop(later, strict=False), key, loose)))
