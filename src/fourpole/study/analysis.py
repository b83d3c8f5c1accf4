"""A campaign becomes a study: static tests, reduction, K1, comparison, identification, tables; the only wiring."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from fourpole.campaign.folder import LIMITS, Campaign, condition_numbers, read_campaign
from fourpole.campaign.place import inside
from fourpole.core.routes import ROUTES
from fourpole.errors import CampaignError
from fourpole.fitting.likelihood import likelihood_of, likelihood_record
from fourpole.io.child import SECONDS
from fourpole.io.door import sha256_of
from fourpole.io.folders import is_for_keeping, make_folder
from fourpole.io.kernel import filling
from fourpole.io.remote import EVERY, allowing
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.write import remove_leftovers
from fourpole.study.agreement import agreement, notes_of
from fourpole.study.cache import Cache
from fourpole.study.compare import compare_points, judge_points
from fourpole.study.identify import check_rig, identify_points, possible_route
from fourpole.study.points import Points, asked_only
from fourpole.study.record import study_record
from fourpole.study.reduce import jobs_of, response_hashes
from fourpole.study.selection import select_tables
from fourpole.study.static import StaticRow, evaluate_statics, stiffness_for
from fourpole.study.study import Study
from fourpole.study.tables import verdict_counts
from fourpole.study.workers import reduce_tests

#: Number of Monte Carlo draws of K* and K1 where value ± 1.96 u is not a 95 % interval of K2 or C.
DRAWS = 10_000
#: Seed of the draws, so that each analysis gives the same intervals.
SEED = 1982


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
    kernel = filling()
    with allowing(EVERY) if remote else nullcontext():
        if not isinstance(campaign, Campaign):
            campaign = read_campaign(campaign)
        route, note = possible_route(campaign, route)
        check_rig(campaign, route)
        cached = None
        if cache is not None and is_for_keeping(Path(cache), campaign.folder):
            kept = make_folder(cache)
            remove_leftovers(kept, abandoned=0.0)
            cached = Cache(kept, verify=verify)
        statics = evaluate_statics(campaign, cached, time_limit)
        points = reduce_tests(
            jobs_of(campaign, campaign.of_kind("dynamic"), route),
            cache=cached,
            workers=workers,
            executor=executor,
            seconds=time_limit,
            progress=progress,
            arrived=arrived,
        )
    rule, per_kelvin = campaign.stated.sameness, campaign.stated.conditions.per_kelvin
    stiffness = tuple(stiffness_for(test, statics, rule, per_kelvin) for test in points.tests)
    points = replace(points, condition=condition_numbers(campaign, points.tests), stiffness=stiffness)
    points, conditions, mixed = compare_points(campaign, points)
    groups, remarks = identify_points(campaign, points, route, monte_carlo, seed)
    conditions += agreement(campaign, points, groups)
    doubts = notes_of(sorted((check for _, check in conditions), key=lambda check: -check.statistic))
    points = asked_only(campaign, judge_points(points, groups, route))
    likelihoods = {group.rig_name: likelihood_of(group.joint) for group in groups if group.joint is not None}
    tables = select_tables(campaign, statics, points, groups, likelihoods, conditions, route)
    estimates = {group.rig_name: group.estimate.record for group in groups if group.estimate is not None}
    found: dict[str, Any] = {
        "settings": {"route": route, "monte_carlo": monte_carlo, "seed": seed},
        "kernel": kernel,
        "verdicts": verdict_counts(tables["static"], tables["dynamic"]),
        "notes": [*([note] if note else []), *remarks, *doubts, *mixed],
        **({"joint": estimates} if estimates else {}),
        "likelihood": {rig: likelihood_record(likelihood) for rig, likelihood in likelihoods.items()},
        "sha256": _hashes(campaign, statics, points),
    }
    return Study(tables=tables, record=study_record(campaign, found), campaign=campaign, likelihoods=likelihoods)


def _hashes(campaign: Campaign, statics: Sequence[StaticRow], points: Points) -> dict[str, str]:
    """Hash of each file that was read, by its name in the campaign."""
    folder, logo = campaign.folder, campaign.stated.report.logo
    hashes = {name: sha256 for name, sha256 in campaign.sha256.items() if name != LIMITS or campaign.limits.limits}
    if logo:
        hashes[logo] = sha256_of(inside(folder, logo), max_bytes=MAX_FILE_BYTES, label=logo, within=folder)
    hashes |= response_hashes(campaign)
    hashes |= {row.test.file: row.sha256 for row in statics if row.sha256}
    return hashes | {test.file: sha256 for test, sha256 in zip(points.tests, points.sha256, strict=True) if sha256}
