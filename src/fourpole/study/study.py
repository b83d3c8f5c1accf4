"""`Study`: the results of a campaign as tables, made by an analysis or read from a folder; as HTML for a notebook."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl
from numpy.typing import ArrayLike

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign
from fourpole.campaign.report import shown_units
from fourpole.core.checks import Verdict
from fourpole.core.condition import AXES, PRELOAD, PRESSURE, Axis, Sameness
from fourpole.core.digits import notebook_html, number
from fourpole.core.joint.around import Likelihood
from fourpole.errors import CampaignError
from fourpole.face import public
from fourpole.fitting.likelihood import read_likelihoods
from fourpole.fitting.rows import conditions_in, names_apart, rule_in
from fourpole.io.folders import make_folder
from fourpole.io.published import Published, publishing
from fourpole.io.write import write_table
from fourpole.models.families import by_amplitude
from fourpole.quantities import TYRE, Quantity, ShownUnits
from fourpole.study.onetest import TestedTables
from fourpole.study.record import place_of, section, texts, write_record
from fourpole.study.rig_estimate import RigEstimate
from fourpole.study.rig_read import read_rig_estimates
from fourpole.study.tables import DYNAMIC, TABLE_FILES, TABLES, verdict_counts
from fourpole.units import nearest, quantity, shown

#: Quantities of the axes that every campaign has.
_STATES = (q.PRESSURE, q.PRELOAD, q.TEMPERATURE)

if TYPE_CHECKING:
    from xarray import Dataset

    from fourpole.fitting.measured import MeasuredSet
    from fourpole.fitting.modelfile import ModelFile
    from fourpole.fitting.modelling import TyreFits


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Study(TestedTables):
    """The results of a campaign: what `analyse` makes and `read_results` reads.

    Attributes
    ----------
    tables : dict of str to polars.DataFrame
        Tables by the name of their file. Each is an attribute, too: `static`, `dynamic`, `checks`, `rig`,
        `residuals`, `quantiles`, `budget`, `corrections`, `lines`, `phasors`, `covariance`, `likelihood` and
        `previews`. A table of a folder is read when it is first asked for; one that the analysis did not make has no
        columns.
    record : dict
        Content of study.json: title, settings, statement of the campaign, versions, verdicts, assumptions, hashes.
    campaign : Campaign or None
        The campaign that was analysed; None for results that were read.
    models, maps : ModelFile or None
        Content of model.json and of map.json; None where there is no such file.
    faults : tuple of str
        Reasons why an existing model file is not used.
    files : Published or None
        The files that were read, for further ones of the same analysis; None for results that are of no folder.

    Examples
    --------
    >>> import tempfile
    >>> from fourpole import analyse, simulate_campaign
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     campaign = simulate_campaign(folder, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True)
    ...     analyse(campaign.folder).counts
    {'ok': 4, 'warning': 0, 'rejected': 0}
    """

    tables: dict[str, pl.DataFrame]
    record: dict[str, Any]
    campaign: Campaign | None
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
        campaign: Campaign | None = None,
        models: ModelFile | None = None,
        maps: ModelFile | None = None,
        faults: tuple[str, ...] = (),
        files: Published | None = None,
        likelihoods: Mapping[str, Likelihood] | None = None,
        **more: pl.DataFrame,
    ) -> None:
        """Tables by name, or in one mapping; a table by name replaces that of the mapping."""
        named = {"static": static, "dynamic": dynamic, "previews": previews, **more}
        held = {**(tables or {}), **{name: table for name, table in named.items() if table is not None}}
        values: dict[str, Any] = {"tables": held, "record": record or {}, "campaign": campaign, "models": models}
        values |= {"maps": maps, "faults": faults, "files": files}
        values |= {"likelihoods": likelihoods} if likelihoods is not None else {}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {verdict}" for verdict, count in self.counts.items() if count)
        tables = ", ".join(f"{name} ({table.height})" for name, table in self.tables.items() if table.height)
        title = shown(self.title, 60)
        return f"<Study {title}: {counts or 'no tests'}, {self.route} route; tables with their rows: {tables}>"

    def _repr_html_(self) -> str:
        """The tests by verdict and the range of each quantity, for a notebook."""
        return tables_html(self.title, self.tables, self.route, self.shown)

    # ---- what study.json says

    @property
    def title(self) -> str:
        """Title of the campaign, or the name of its folder."""
        folder = self.campaign.folder.name if self.campaign is not None else ""
        return str(self.record.get("title") or folder or "Results")

    @property
    def route(self) -> str:
        """The route by which K* was found; empty if it is not known."""
        return str(section(self.record, "settings").get("route") or "")

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What is taken for values that the campaign does not state."""
        return tuple(texts(self.record.get("assumptions")))

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the route and the rigs, then the assumptions."""
        return (*texts(self.record.get("notes")), *self.assumptions)

    @property
    def sha256(self) -> dict[str, str]:
        """Hash of each file that was read, by its name in the campaign."""
        return {str(name): str(value) for name, value in section(self.record, "sha256").items()}

    @property
    def rule(self) -> Sameness:
        """When two tests are of one condition, by the campaign's own rule."""
        return rule_in(self.record)

    @cached_property
    def shown(self) -> ShownUnits:
        """The units in which the campaign wants its results shown; the tables are in SI."""
        return shown_units(section(self.record, "stated", "report").get("units"))

    @property
    def dynamic_sha256(self) -> str:
        """SHA-256 of dynamic.csv, as study.json lists it; empty if it lists none."""
        return str(section(self.record, "results").get(f"{DYNAMIC.name}.csv") or "")

    # ---- the tests and the rigs

    @property
    def counts(self) -> dict[str, int]:
        """Number of tests by verdict; a test with several rows counts by its worst verdict."""
        return verdict_counts(self.static, self.dynamic)

    @property
    def results(self) -> Study:
        """The study itself, for scripts of earlier versions, in which the results were another class."""
        return self

    @property
    def rigs(self) -> tuple[RigEstimate, ...]:
        """The rigs as found by the joint route, in the order of rig.csv; none where another route was used."""
        return read_rig_estimates(self.rig, self.residuals, self.record.get("joint"))

    def rig_named(self, name: str) -> RigEstimate:
        """The rig of this name as found; with default values if the joint route found no such rig."""
        return next((estimate for estimate in self.rigs if estimate.rig == name), RigEstimate(name))

    @cached_property
    def derived(self) -> dict[Any, Any]:
        """What readers of the tables have made of them, by keys of theirs; kept as long as the results."""
        return {}

    def apart(self, *, texts_only: bool = False) -> Study:
        """The results with distinct names of specimens: "radial at 60 °C" where it was tested at several temperatures.

        The further axes of the campaign's conditions are named likewise; with `texts_only` only axes of text are.
        """
        rule = rule_in(self.record).without(PRESSURE.name, PRELOAD.name)
        rule = Sameness(tuple(axis for axis in rule.axes if axis.text or not texts_only))
        tables = {name: table for name in ("static", "dynamic") if TYRE.head in (table := self.tables[name]).columns}
        named = names_apart([conditions_in(table, rule) for table in tables.values()], rule)
        made = {
            name: table.with_columns(pl.Series(TYRE.head, names, dtype=pl.String))
            for (name, table), names in zip(tables.items(), named, strict=True)
        }
        return self._with_tables({**self.tables, **made})

    def _with_tables(self, tables: dict[str, pl.DataFrame]) -> Study:
        """The study with other tables; likelihoods that are no part of its files are kept."""
        study = replace(self, tables=tables)
        vars(study).update({"likelihoods": self.likelihoods} if "likelihoods" in vars(self) else {})
        return study

    # ---- figures, models and maps

    def plot(self, figure: str = "stiffness", *, style: Any = None, **where: str | float) -> Any:
        """A figure of the results, as `fourpole.draw` makes it: ``study.plot("K2", tyre="radial")``; see `only`."""
        return public("draw")(self.only(**where) if where else self, figure, style=style)

    def only(self, **where: str | float) -> Study:
        """The study with the tests of one specimen and state alone.

        Parameters
        ----------
        where : str or float
            ``tyre``, or ``specimen``, and values by the name of an axis of a condition: pressure [Pa], preload [N],
            temperature [degC] or an axis of the campaign. A text has its unit: ``pressure="1.7 bar"``.

        Raises
        ------
        CampaignError
            If there is no such axis, or no test has the value; the message has the nearest.
        """
        kept = {name: self.table(name) for name in TABLES}
        for axis, value in where.items():
            for name in ("static", "dynamic"):
                kept[name] = kept[name].filter(self._is_at(kept[name], axis, value))
            if not any(kept[name].height for name in ("static", "dynamic")):
                there = self._values_of(axis)
                named = axis in ("tyre", "specimen") or self._axis(axis).text
                near = nearest(str(value), there) if named else ""
                hint = f"did you mean {near!r}?" if near else f"there is {', '.join(there) or 'none'}"
                raise CampaignError(f"no test has {axis} {shown(str(value))}: {hint}")
        tests = pl.concat([kept[name].select(q.TEST.head) for name in ("static", "dynamic")])[q.TEST.head].unique()
        further = {
            name: table.filter(pl.col(q.TEST.head).is_in(tests.implode()))
            for name, table in kept.items()
            if q.TEST.head in table.columns
        }
        return self._with_tables({**kept, **further})

    def _is_at(self, table: pl.DataFrame, axis: str, value: str | float) -> pl.Series:
        """Whether each row has this value on an axis, within the tolerance of the campaign's rule."""
        if axis in ("tyre", "specimen"):
            return table[TYRE.head] == str(value)
        wanted = self._axis(axis)
        kind = {"pressure": "pressure", "preload": "force", "temperature": "temperature"}.get(axis)
        number = quantity(value, kind) if isinstance(value, str) and kind is not None else value
        conditions = conditions_in(table, Sameness((wanted,)))
        return pl.Series([wanted.same(condition.values[0], number) for condition in conditions], dtype=pl.Boolean)

    def _axis(self, name: str) -> Axis:
        axes = {axis.name: axis for axis in self.rule.axes}
        if name not in axes:
            near = nearest(name, ("tyre", *axes))
            hint = f"did you mean {near!r}?" if near else f"there are tyre, {', '.join(axes)}"
            raise CampaignError(f"no axis {shown(name)}: {hint}")
        return axes[name]

    def _values_of(self, axis: str) -> list[str]:
        """The values that tests have on an axis, as texts."""
        column = TYRE.head if axis in ("tyre", "specimen") else self._axis(axis).column
        tables = [table for table in (self.static, self.dynamic) if column in table.columns]
        values = dict.fromkeys(value for table in tables for value in table[column].to_list() if value is not None)
        scale, unit = {one.head: (one.scale, f" {one.shown}") for one in _STATES}.get(column, (1.0, ""))
        return [f"{value / scale:.6g}{unit}" if isinstance(value, float) else str(value) for value in values]

    @cached_property
    def likelihoods(self) -> Mapping[str, Likelihood]:
        """The tests of each rig as the joint route weighed them."""
        return read_likelihoods(self.files) if self.files is not None else {}

    @property
    def measured(self) -> MeasuredSet:
        """K* of each condition with its covariance: the input of model fits."""
        return self._measured()

    def _measured(self, model: str = "", over: Sequence[str] = ()) -> MeasuredSet:
        """K* as a model takes it, with each amplitude apart if it depends on them, or over further columns."""
        from fourpole.fitting.measured import measured_of

        covariance = self.covariance if self.covariance.height else None
        return measured_of(
            self.dynamic,
            covariance,
            self.likelihoods,
            over=over,
            name="the study",
            rule=self.rule,
            by_amplitude=by_amplitude(model),
        )

    def fit(self, model: str = "auto") -> TyreFits:
        """A model for each tyre, fitted in every condition by itself; `auto` chooses a model and says why.

        Returns
        -------
        TyreFits
            The fits in the order of the tyres; a name gives that of its tyre: ``study.fit()["radial"]``.

        Raises
        ------
        ModelError
            If there is no such model, or K* is known at too few frequencies.
        """
        from fourpole.fitting.modelling import TyreFits, fit_tyres

        return TyreFits(fit_tyres(self._measured(model), model))

    def map(
        self,
        model: str = "auto",
        *,
        tyre: str | None = None,
        over: Sequence[str] = (),
        at: Mapping[str, ArrayLike] | None = None,
    ) -> Dataset:
        """The operating map on a grid, as xarray; needs the extra `maps`.

        Parameters
        ----------
        model : str
            Name of a model, or `auto`: the causal model with the greatest leave-one-out log predictive density.
        tyre : str, optional
            The tyre whose map is used; by default all tyres.
        over : sequence of str
            Further columns that are axes, in addition to pressure, preload and temperature.
        at : mapping of str to (n,) float array, optional
            Coordinates in SI by the name of an axis: {"pressure": [1.85e5], "frequency": [13.7]}; by default an even
            grid over the measured range.

        Returns
        -------
        xarray.Dataset
            K_storage, K_loss, loss_factor, K1, K2, C and TR, each with u_NAME, over tyre, the axes and frequency;
            not-a-number outside the measured range.

        Raises
        ------
        ModelError
            If there is no such tyre or axis, or no surface can be fitted.
        CampaignError
            If xarray is not installed.
        """
        from fourpole.fitting.grid import grid_of
        from fourpole.fitting.inertia import mean_inertia
        from fourpole.fitting.modelling import map_tyres
        from fourpole.fitting.stated import rig_file, rig_in

        maps = map_tyres(self._measured(model, over).only(tyre), model, over)
        rig = rig_in(rig_file(self.record, self.rig))
        bodies = {one.tyre: mean_inertia([each.inertia for each in one.measured]) for one in maps}
        belts = {tyre: one.specimen for tyre, one in bodies.items() if one is not None}
        return grid_of({surface.tyre: surface.best for surface in maps}, rig, at, specimens=belts)

    def to_pandas(self, table: str = "dynamic") -> Any:
        """A table as a pandas.DataFrame; needs pandas, and no pyarrow.

        Raises
        ------
        CampaignError
            If pandas is not installed, or there is no such table.
        """
        if table not in TABLES:
            near = nearest(table, TABLES)
            raise CampaignError(f"no table {shown(table)}: {f'did you mean {near!r}' if near else ', '.join(TABLES)}")
        try:
            pandas: Any = import_module("pandas")
        except ImportError:
            raise CampaignError("pandas is not installed: pip install pandas") from None
        frame = self.table(table)
        return pandas.DataFrame({name: frame[name].to_list() for name in frame.columns})

    def write(self, folder: str | Path, further: Mapping[str, pl.DataFrame] | None = None) -> Path:
        """Write all tables and study.json into a folder, all together or none.

        Files of an earlier analysis that would not belong to these tables are deleted: optional tables, findings.csv
        and report.html.

        Parameters
        ----------
        folder : path
            A folder that does not exist is made.
        further : mapping of str to polars.DataFrame, optional
            Tables by name that are written with them as CSV, as findings.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        CampaignError
            If the folder cannot be made.
        FileError
            If a file cannot be written; all files are the former ones then.
        """
        folder = make_folder(folder)
        with publishing(folder, (*TABLE_FILES, "findings.csv", "report.html")) as new:
            self.write_into(new, folder, further)
        return folder

    def write_into(self, new: Path, folder: Path, further: Mapping[str, pl.DataFrame] | None = None) -> None:
        """Write all tables and study.json into the new folder of `publishing`, for a folder; see `write`."""
        for spec in TABLES.values():
            table = self.table(spec.name)
            for ending in spec.endings if table.height or spec.always else ():
                write_table(new / f"{spec.name}{ending}", table)
        for name, table in (further or {}).items():
            write_table(new / f"{name}.csv", table)
        place = {"campaign": place_of(self.campaign.folder, folder)} if self.campaign is not None else {}
        write_record(new, {**self.record, **place})


_SHOWN = (q.K1, q.STORAGE, q.LOSS_FACTOR, q.K2, q.C, q.TR_MEASURED)
_RULE = Sameness(AXES)


def tables_html(title: str, tables: Mapping[str, pl.DataFrame], route: str, units: ShownUnits) -> str:
    """The tests by verdict, and a row for each condition of dynamic.csv.

    Parameters
    ----------
    title, route : str
    tables : mapping of str to polars.DataFrame
        Tables by the name of their file.
    units : ShownUnits
        The units to show.
    """
    dynamic = tables.get("dynamic", pl.DataFrame())
    counts = verdict_counts(tables.get("static", pl.DataFrame()), dynamic)
    said = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    lines = [f"{sum(counts.values())} tests: {said}; {route or 'unknown'} route", "lowest to highest of each condition"]
    shown = [units.of(quantity) for quantity in _SHOWN if quantity.head in dynamic.columns]
    quantities = [f"{quantity.symbol} [{quantity.suffix}]".replace(" []", "") for quantity in shown]
    heads = ["condition", "tests", q.FREQUENCY.head, *quantities]
    return notebook_html(title, lines, heads, list(_rows(dynamic, shown, units)))


def _rows(dynamic: pl.DataFrame, shown: list[Quantity], units: ShownUnits) -> Iterator[list[str]]:
    if q.TYRE.head not in dynamic.columns:
        return
    used = dynamic.filter(pl.col(q.VERDICT.head) != Verdict.REJECTED)
    conditions = conditions_in(used, _RULE)
    groups = _RULE.groups(conditions).tolist()
    for group in dict.fromkeys(groups):
        members = [row for row, other in enumerate(groups) if other == group]
        first, part = conditions[members[0]], used[members]
        values = [(axis, value) for axis, value in zip(AXES, first.values, strict=True) if isinstance(value, float)]
        stated = ", ".join([first.specimen, *(units.setting(axis.column, value) for axis, value in values)])
        ranges = [_range(part, quantity) for quantity in (q.FREQUENCY, *shown)]
        yield [stated, str(part[q.TEST.head].n_unique()), *ranges]


def _range(table: pl.DataFrame, quantity: Quantity) -> str:
    values = table[quantity.head].drop_nulls().drop_nans()
    if values.is_empty():
        return ""
    low, high = (number(float(end) / quantity.scale) for end in (values.min(), values.max()))  # type: ignore[arg-type]
    return low if low == high else f"{low} .. {high}"
