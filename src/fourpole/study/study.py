"""`Study`: the results of a campaign as tables, and their files."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl
from numpy.typing import ArrayLike

from fourpole.campaign.conditions import condition_numbers
from fourpole.campaign.folder import LIMITS, Campaign, Test, read_campaign
from fourpole.campaign.place import inside
from fourpole.core.joint.around import Likelihood
from fourpole.core.routes import ROUTES
from fourpole.errors import CampaignError
from fourpole.face import public
from fourpole.fitting.likelihood import likelihood_of, likelihood_record
from fourpole.fitting.rows import axes_record
from fourpole.fitting.stated import rig_file
from fourpole.io.child import SECONDS
from fourpole.io.door import sha256_of
from fourpole.io.folders import is_for_keeping
from fourpole.io.origin import origin
from fourpole.io.published import publishing
from fourpole.io.remote import EVERY, allowing
from fourpole.io.write import remove_leftovers, write_table
from fourpole.models.families import by_amplitude
from fourpole.study.cache import Cache
from fourpole.study.compare import compare_points
from fourpole.study.identify import identify_points, no_rig, possible_route
from fourpole.study.load import MOST_BYTES
from fourpole.study.notebook import tables_html
from fourpole.study.onetest import TestsByName
from fourpole.study.points import Points, StaticStiffness
from fourpole.study.record import write_record
from fourpole.study.reduce import jobs_of, response_hashes
from fourpole.study.results import Results
from fourpole.study.rig_estimate import RigEstimate
from fourpole.study.selection import select_tables
from fourpole.study.static import StaticTest, evaluate_statics, stiffness_for
from fourpole.study.tables import TABLE_FILES, TABLES, Tables, verdict_counts
from fourpole.study.verdicts import judge_points
from fourpole.study.workers import Settings, reduce_tests
from fourpole.units import shown
from fourpole.version import VERSION

if TYPE_CHECKING:
    from xarray import Dataset

    from fourpole.fitting.measured import MeasuredSet
    from fourpole.fitting.modelling import TyreFit

#: Number of Monte Carlo draws of K* and K1 where value ± 1.96 u is not a 95 % interval of K2 or C.
DRAWS = 10_000
#: Seed of the draws, so that each analysis gives the same intervals.
SEED = 1982


@dataclass(frozen=True, eq=False)
class Study(Tables):
    """Result tables of a campaign.

    Attributes
    ----------
    campaign : Campaign
        The campaign that was analysed.
    tables : mapping of str to polars.DataFrame
        Tables by the name of their file. Each is an attribute, too: `static`, `dynamic`, `checks`, `rig`,
        `residuals`, `quantiles`, `budget`, `corrections`, `phasors`, `covariance`, `likelihood` and `previews`.
    route : str
        The route by which K* was found.
    rigs : tuple of RigEstimate
        The rigs as found by the joint route; none where another route was used.
    monte_carlo : int
        Number of draws where value ± 1.96 u is not a 95 % interval of K2 or C.
    likelihoods : mapping of str to Likelihood
        The tests of each rig as the joint route weighed them.
    notes : tuple of str
        Notes on the route and the rigs, and the assumptions.
    assumptions : tuple of str
        What is taken for values that the campaign does not state.
    sha256 : dict of str to str
        Hash of each file read.
    seed : int
        Seed of the draws.

    Examples
    --------
    >>> import tempfile
    >>> from fourpole.virtual import simulate_campaign
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     campaign = simulate_campaign(folder, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True)
    ...     analyse(campaign.folder).counts
    {'ok': 4, 'warning': 0, 'rejected': 0}
    """

    campaign: Campaign
    tables: Mapping[str, pl.DataFrame]
    route: str
    rigs: tuple[RigEstimate, ...] = ()
    monte_carlo: int = DRAWS
    likelihoods: Mapping[str, Likelihood] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    sha256: dict[str, str] = field(default_factory=dict)
    seed: int = SEED

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {verdict}" for verdict, count in self.counts.items() if count)
        tables = ", ".join(f"{name} ({table.height})" for name, table in self.tables.items() if table.height)
        title = shown(self.campaign.stated.title or self.campaign.folder.name, 60)
        return f"<Study {title}: {counts or 'no tests'}, {self.route} route; tables with their rows: {tables}>"

    def _repr_html_(self) -> str:
        """The tests by verdict and the range of each quantity, for a notebook."""
        title = self.campaign.stated.title or self.campaign.folder.name
        return tables_html(title, self.tables, self.route, self.campaign.stated.report.shown)

    @property
    def counts(self) -> dict[str, int]:
        """Number of tests by verdict; a test with several rows counts by its worst verdict."""
        return verdict_counts(self.static, self.dynamic)

    @property
    def tests(self) -> TestsByName:
        """The tests by name: `study.tests["D12"]` has its rows, amplitudes, verdict, remarks and recording."""
        return TestsByName(self)

    def plot(self, figure: str = "stiffness", **options: Any) -> Any:
        """A figure of the results, as `fourpole.draw` makes it: `study.plot("K2")`."""
        return public("draw")(self.results, figure, **options)

    @cached_property
    def results(self) -> Results:
        """The tables from which figures and reports are made, with what readers have derived of them."""
        read = {name: table for name, table in self.tables.items() if TABLES[name].read}
        return Results(record=self.record, tables=read)

    @property
    def measured(self) -> MeasuredSet:
        """K* of each condition with its covariance: the input of model fits."""
        return self._measured()

    def _measured(self, model: str = "", over: Sequence[str] = ()) -> MeasuredSet:
        """K* as a model takes it, with each amplitude apart if it depends on them, or over further columns."""
        from fourpole.fitting.measured import measured_of

        rule, moved = self.campaign.stated.sameness, by_amplitude(model)
        return measured_of(
            self.dynamic,
            self.covariance,
            self.likelihoods,
            over=over,
            name="the study",
            rule=rule,
            by_amplitude=moved,
        )

    def fit(self, model: str = "auto") -> list[TyreFit]:
        """A model for each tyre, fitted in every condition by itself; `auto` chooses a model and says why.

        Raises
        ------
        ModelError
            If there is no such model, or K* is known at too few frequencies.
        """
        from fourpole.fitting.modelling import fit_tyres

        return fit_tyres(self._measured(model), model)

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
            Name of a model, or `auto`: the model with the smallest leave-one-out error.
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
        from fourpole.fitting.modelling import map_tyres
        from fourpole.fitting.query import rig_in

        maps = map_tyres(self._measured(model, over).only(tyre), model, over)
        rig = rig_in(rig_file(self.record, self.rig))
        return grid_of({one.tyre: one.best for one in maps}, rig, at)

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
            self.write_into(new, further)
        return folder

    def write_into(self, folder: Path, further: Mapping[str, pl.DataFrame] | None = None) -> None:
        """Write all tables and study.json into the new folder of `publishing`; see `write`."""
        for spec in TABLES.values():
            table = self.tables[spec.name]
            for ending in spec.endings if table.height or spec.always else ():
                write_table(folder / f"{spec.name}{ending}", table)
        for name, table in (further or {}).items():
            write_table(folder / f"{name}.csv", table)
        write_record(folder, self.record)

    @property
    def record(self) -> dict[str, Any]:
        """Content of study.json without the hashes of the results: all that is needed to repeat the analysis."""
        from importlib.metadata import version  # slow to load

        packages = ("numpy", "scipy", "polars", "pint", "pydantic")
        return {
            "title": self.campaign.stated.title,
            "settings": {"route": self.route, "monte_carlo": self.monte_carlo, "seed": self.seed},
            "conditions": {"axes": axes_record(self.campaign.stated.sameness)},
            "stated": self.campaign.statement(),
            "versions": {
                "python": platform.python_version(),
                "fourpole": VERSION,
                **{name: version(name) for name in packages},
            },
            "origin": origin().record,
            "verdicts": self.counts,
            "assumptions": list(self.assumptions),
            "notes": [note for note in self.notes if note not in self.assumptions],
            **({"joint": {rig.rig: rig.record for rig in self.rigs}} if self.rigs else {}),
            "likelihood": {rig: likelihood_record(one) for rig, one in self.likelihoods.items()},
            "sha256": self.sha256,
        }


def make_folder(folder: str | Path) -> Path:
    """The folder, made where it does not exist; CampaignError where it cannot be made."""
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise CampaignError(f"{folder}: is a file, or lies below one: name a folder for the results") from None
    except (OSError, ValueError) as error:
        raise CampaignError(
            f"{folder}: the folder cannot be made: {getattr(error, 'strerror', None) or error}"
        ) from None
    return folder


def analyse(
    campaign: Campaign | str | Path,
    *,
    route: str = "joint",
    monte_carlo: int = DRAWS,
    seed: int = SEED,
    cache: str | Path | None = None,
    verify: bool = False,
    workers: int | None = None,
    executor: Executor | None = None,
    time_limit: float = SECONDS,
    remote: bool = False,
    progress: Callable[[int, int], None] | None = None,
    arrived: Callable[[str, Points], None] | None = None,
) -> Study:
    """Analyse a campaign: static curves, demodulation, identification, tables.

    Parameters
    ----------
    campaign : Campaign or path
        A campaign, or its folder.
    route : {"joint", "mobility", "relative", "transmissibility"}
        The route to K*; in place of the joint route the route that the campaign allows is used, with a note.
    monte_carlo : int
        Number of draws for the intervals of K2 and C where value ± 1.96 u is none; 0 for no intervals.
    seed : int
        Seed of the draws.
    cache : path, optional
        Folder of the phasors of each recording; an interrupted analysis continues from it.
    verify : bool
        Whether every recording is hashed; otherwise a recording with the size, time of change and inode that the cache
        noted is not opened.
    workers : int, optional
        Number of worker processes that demodulate the recordings, or 1 for this thread; by default as many as pay.
        They are started afresh, and do not import the calling script: it needs no ``if __name__ == "__main__"``.
    executor : concurrent.futures.Executor, optional
        Executor that runs batches of recordings in place of these processes, in threads, in processes or on other
        machines, as that of `dask.distributed.Client.get_executor`.
    time_limit : float [s]
        Processor time after which a recording is given up; a large file has 1 s per MB more. It holds in worker
        processes, in which large files and those that a library reads are always read.
    remote : bool
        Whether all recordings that are named by s3:// are read; otherwise those that the variable FOURPOLE_REMOTE or
        the user's config.toml allows.
    progress : callable, optional
        Called with the number of reduced recordings and the number of all recordings.
    arrived : callable, optional
        Called with the name of each test of these recordings and what its recording gives by itself, as it is reduced.

    Returns
    -------
    Study
        Tables with a row for every test; no file is written but the cache.

    Raises
    ------
    CampaignError
        If the campaign as a whole cannot be used.

    Examples
    --------
    >>> import tempfile
    >>> from fourpole.virtual import simulate_campaign
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     campaign = simulate_campaign(folder, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True)
    ...     study = analyse(campaign.folder)
    >>> study.dynamic["C [N s/m]"].round(3).to_list()
    [1399.8, 808.217]
    """
    if route not in ("joint", *ROUTES):
        raise CampaignError(f"no route {route!r}: choose one of joint, {', '.join(ROUTES)}")
    with allowing(EVERY) if remote else nullcontext():
        if not isinstance(campaign, Campaign):
            campaign = read_campaign(campaign)
        dynamic = campaign.of_kind("dynamic")
        route, note = possible_route(campaign, route)
        _check_rig(campaign, dynamic, route)

        kept = None
        if cache is not None and is_for_keeping(Path(cache), campaign.folder):
            kept = make_folder(cache)
            remove_leftovers(kept, abandoned=0.0)
        cached = Cache(kept, verify=verify) if kept is not None else None
        statics = evaluate_statics(campaign, cached, time_limit)
        points = reduce_tests(
            jobs_of(campaign, dynamic, route),
            cache=cached,
            settings=Settings(workers, executor, time_limit),
            progress=progress,
            arrived=arrived,
        )
    dynamic_k1 = (_stiffness(test, statics, campaign) for test in points.tests)
    points = replace(points, condition=condition_numbers(campaign, points.tests), stiffness=tuple(dynamic_k1))
    compared = compare_points(campaign, points)
    groups, remarks = identify_points(campaign, compared.points, compared.strange, route, monte_carlo, seed)
    points = judge_points(compared.points, groups, route)
    for group in groups:
        points = points.with_columns(group.rows, group.columns)
    assumed = (*campaign.stated.assumptions(), *_assumed(dynamic))
    return Study(
        campaign=campaign,
        tables=select_tables(campaign, statics, points, groups, compared.conditions, route),
        route=route,
        rigs=tuple(group.estimate for group in groups if group.estimate is not None),
        monte_carlo=monte_carlo,
        likelihoods={group.rig_name: likelihood_of(group.joint) for group in groups if group.joint is not None},
        notes=(*([note] if note else []), *remarks, *compared.notes, *assumed),
        assumptions=assumed,
        sha256=_hashes(campaign, statics, points),
        seed=seed,
    )


def _check_rig(campaign: Campaign, dynamic: Sequence[Test], route: str) -> None:
    rigs = campaign.stated.all_rigs
    if not rigs and route != "relative" and any(test.kind in ("dynamic", "calibration") for test in dynamic):
        raise CampaignError(no_rig(campaign, route))
    if route == "transmissibility" and any(rig.output == "blocked" for rig in rigs.values()):
        raise CampaignError(
            "campaign.toml: [rig] output is blocked, so there is no transmissibility: use --route mobility"
        )


def _stiffness(test: Test, statics: Sequence[StaticTest], campaign: Campaign) -> StaticStiffness:
    """K1 of a test; a rigid block has none."""
    stated, rows = campaign.stated, [row for static in statics for row in static.rows]
    if test.kind == "calibration":
        return StaticStiffness()
    return stiffness_for(test, rows, stated.sameness, stated.conditions.per_kelvin)


def _assumed(tests: Sequence[Test]) -> list[str]:
    """Assumptions where tests.csv states no uncertainty."""
    stated = (("K1", "2 %"), ("added_mass", "0.2 % of it"))
    return [
        f"tests.csv: {name} is stated without u({name}), taken as {taken}"
        for name, taken in stated
        if any(test.value(name) and test.value(f"u({name})") is None for test in tests)
    ]


def _hashes(campaign: Campaign, statics: Sequence[StaticTest], points: Points) -> dict[str, str]:
    """Hash of each file that was read, by its name in the campaign."""
    folder, logo = campaign.folder, campaign.stated.report.logo
    hashes = {name: sha256 for name, sha256 in campaign.sha256.items() if name != LIMITS or campaign.limits.limits}
    if logo:
        hashes[logo] = sha256_of(inside(folder, logo), max_bytes=MOST_BYTES, label=logo, within=folder)
    hashes |= response_hashes(campaign)
    hashes |= {static.test.file: static.sha256 for static in statics if static.sha256}
    return hashes | {test.file: sha256 for test, sha256 in zip(points.tests, points.sha256, strict=True) if sha256}
