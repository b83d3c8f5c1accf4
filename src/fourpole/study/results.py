"""`Results`: the tables of an analysed campaign, from memory or read from their folder."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl

from fourpole.campaign.shown import shown_units
from fourpole.core.condition import PRELOAD, PRESSURE, Sameness
from fourpole.errors import CampaignError, FileError, FourpoleError, TableError
from fourpole.face import public
from fourpole.fitting.rows import checked, conditions_in, each_once, names_apart, rule_in
from fourpole.io.folders import results_in, why_no_folder
from fourpole.io.published import LIST, Published, consistently, published_beside
from fourpole.quantities import TYRE, ShownUnits
from fourpole.study.notebook import tables_html
from fourpole.study.rig_estimate import RigEstimate
from fourpole.study.rig_reading import read_rig_estimates
from fourpole.study.tables import DYNAMIC, OPTIONAL, TABLES, Tables, TableSpec

if TYPE_CHECKING:
    from fourpole.fitting.modelfile import ModelFile

_AGAIN = "run fourpole analyse again"
_MADE_BY = {"model": "fit", "map": "map"}


@dataclass(frozen=True, eq=False, init=False)
class Results(Tables):
    """Tables of an analysed campaign: the input of figures, reports and exports.

    Attributes
    ----------
    tables : mapping of str to polars.DataFrame
        Tables by the name of their file. Each is an attribute, too: `static`, `dynamic`, `checks`, `rig`, `residuals`,
        `quantiles`, `budget`, and `previews`, a few cycles of signal and fit of each recording. A table that the
        analysis did not make has no columns. So have `corrections`, `phasors`, `covariance` and `likelihood`, which
        `read_results` does not read; the tables of a `Study` have them.
    record : dict
        Content of study.json: title, settings, statement of the campaign, versions, verdicts, assumptions, hashes.
    models, maps : ModelFile or None
        Content of model.json and of map.json; None where there is no such file.
    faults : tuple of str
        Reasons why an existing model file is not used.
    files : Published or None
        The files that were read, for further ones of the same analysis; None for results that are of no folder.
    """

    tables: Mapping[str, pl.DataFrame]
    record: dict[str, Any]
    models: ModelFile | None
    maps: ModelFile | None
    faults: tuple[str, ...]
    files: Published | None

    def __init__(
        self,
        static: pl.DataFrame | None = None,
        dynamic: pl.DataFrame | None = None,
        previews: pl.DataFrame | None = None,
        record: dict[str, Any] | None = None,
        *,
        tables: Mapping[str, pl.DataFrame] | None = None,
        models: ModelFile | None = None,
        maps: ModelFile | None = None,
        faults: tuple[str, ...] = (),
        files: Published | None = None,
        **more: pl.DataFrame,
    ) -> None:
        """Tables by name, or in one mapping; a table by name replaces that of the mapping."""
        named = {"static": static, "dynamic": dynamic, "previews": previews, **more}
        held = {**(tables or {}), **{name: table for name, table in named.items() if table is not None}}
        values: dict[str, Any] = {"tables": held, "record": record or {}, "models": models, "maps": maps}
        values |= {"faults": faults, "files": files}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _repr_html_(self) -> str:
        """The tests by verdict and the range of each quantity, for a notebook."""
        route = str(section(self.record, "settings").get("route") or "")
        return tables_html(str(self.record.get("title") or "Results"), self.tables, route, self.shown)

    def plot(self, figure: str = "stiffness", **options: Any) -> Any:
        """A figure of the results, as `fourpole.draw` makes it: `results.plot("K2")`."""
        return public("draw")(self, figure, **options)

    @property
    def sha256(self) -> str:
        """SHA-256 of dynamic.csv, as study.json lists it; empty if it lists none."""
        return str(section(self.record, "results").get(f"{DYNAMIC.name}.csv") or "")

    @cached_property
    def derived(self) -> dict[Any, Any]:
        """What readers of the tables have made of them, by keys of theirs; kept as long as the results."""
        return {}

    @cached_property
    def shown(self) -> ShownUnits:
        """The units in which the campaign wants its results shown; the tables are in SI."""
        return shown_units(section(self.record, "stated", "report").get("units"))

    @property
    def rigs(self) -> tuple[RigEstimate, ...]:
        """The rigs as found by the joint route, in the order of rig.csv; none where another route was used."""
        return read_rig_estimates(self.rig, self.residuals, self.record.get("joint"))

    def rig_named(self, name: str) -> RigEstimate:
        """The rig of this name as found; with default values if the joint route found no such rig."""
        return next((found for found in self.rigs if found.rig == name), RigEstimate(name))

    def apart(self, *, texts_only: bool = False) -> Results:
        """The results with distinct names of specimens: "radial at 60 °C" where it was tested at several temperatures.

        The further axes of the campaign's conditions are named likewise; with `texts_only` only axes of text are.
        """
        rule = rule_in(self.record).without(PRESSURE.name, PRELOAD.name)
        rule = Sameness(tuple(axis for axis in rule.axes if axis.text or not texts_only))
        found = {name: table for name in ("static", "dynamic") if TYRE.head in (table := self.tables[name]).columns}
        named = names_apart([conditions_in(table, rule) for table in found.values()], rule)
        made = {
            name: table.with_columns(pl.Series(TYRE.head, names, dtype=pl.String))
            for (name, table), names in zip(found.items(), named, strict=True)
        }
        return replace(self, tables={**self.tables, **made})


def units_beside(path: Path) -> ShownUnits:
    """The units that the campaign of some results wants, by their folder or a file in it; the usual ones without."""
    folder = path if path.is_dir() else path.parent
    try:
        record = published_beside(folder / LIST).record
    except (FileError, TableError):
        return ShownUnits()
    return shown_units(section(record, "stated", "report").get("units"))


def section(value: object, *path: str) -> dict[str, Any]:
    """The table at a path of nested tables, as of study.json; empty if there is none."""
    for name in path:
        value = value.get(name) if isinstance(value, dict) else None
    return value if isinstance(value, dict) else {}


def stated_blocked(record: object, rig: str) -> bool:
    """Whether campaign.toml states that the far side of a rig does not move: output = "blocked"."""
    return section(record, "stated", "rigs", rig).get("output") == "blocked"


def texts(value: object) -> list[str]:
    """The items of a list as texts; empty if the value is no list."""
    return [str(item) for item in value] if isinstance(value, list) else []


def read_results(folder: str | Path) -> Results:
    """Read what `Study.write` wrote.

    Parameters
    ----------
    folder : path
        A results folder, or the folder of a campaign with its results in `results`.

    Returns
    -------
    Results
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


def _read_published(found: Published) -> Results:
    tables = {spec.name: read_table(found, spec) for spec in TABLES.values() if spec.read}
    return with_models(
        Results(record=found.record, tables=tables, files=found), found, found.sha256(f"{DYNAMIC.name}.csv")
    )


def with_models(results: Results, found: Published, sha256: str, names: Collection[str] = ("model", "map")) -> Results:
    """The results with those model files of a folder that were made of the dynamic.csv of this SHA-256."""
    from fourpole.fitting.modelfile import model_file_of

    files: dict[str, Any] = {}
    faults = []
    for name in names:
        file = f"{name}.json"
        try:
            made = model_file_of(found.read(file), file) if found.has(file) else None
        except FourpoleError as error:
            faults.append(f"{error}; left out: run fourpole {_MADE_BY[name]} again")
            continue
        if made is not None and made.provenance.sha256 != sha256:
            faults.append(f"{file} is of other results and left out: run fourpole {_MADE_BY[name]} again")
        elif made is not None:
            files[f"{name}s"] = made
    return replace(results, faults=tuple(faults), **files)


def read_table(results: Published, spec: TableSpec, needed: Collection[str] | None = None) -> pl.DataFrame:
    """A table as it was written; a table without columns where an optional file is missing.

    A column of `needed`, by default any column, that the file does not have is an error.
    """
    name, ending = f"{spec.name}{spec.endings[0]}", spec.endings[0]
    if (not spec.always or ending == ".parquet") and not results.has(name):
        return pl.DataFrame()
    try:
        frame = _frame(results.read(name), name, {**OPTIONAL, **spec.columns})
        frame = each_once(frame, name) if spec is DYNAMIC else frame
    except pl.exceptions.PolarsError as error:
        why = str(error).partition("\n")[0][:200]
        raise CampaignError(f"{name}: cannot be read ({why}): {_AGAIN}") from None
    except TableError as error:
        raise CampaignError(f"{error}: {_AGAIN}") from None
    lacking = [name for name in (spec.columns if needed is None else needed) if name not in frame.columns]
    if lacking and ending != ".parquet":
        raise CampaignError(f"{name}: has no column {lacking[0]!r}: {_AGAIN}")
    return frame if ending == ".parquet" else frame.with_columns(pl.col(pl.String).fill_null(""))


def _frame(content: bytes, name: str, known: Mapping[str, Any]) -> pl.DataFrame:
    """The table of a CSV or Parquet file, its columns of known kinds; TableError for a cell of another kind."""
    if name.endswith(".parquet"):
        return checked(pl.read_parquet(content), name, known)
    names = pl.read_csv(content, n_rows=0, infer_schema=False).columns
    kinds = {name: known.get(name, pl.String) for name in names}
    counts = [name for name, kind in kinds.items() if kind == pl.Int64]  # another program may write 4.0 for 4
    numbers = {**kinds, **dict.fromkeys(counts, pl.Float64)}
    try:
        frame = checked(pl.read_csv(content, schema=numbers), name)
    except pl.exceptions.PolarsError:
        checked(pl.read_csv(content, infer_schema=False), name, numbers)  # names the cell at fault
        raise
    return frame.with_columns(pl.col(counts).cast(pl.Int64, strict=False))
