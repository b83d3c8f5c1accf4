"""The commands on a whole campaign: analyse and demo."""

from __future__ import annotations

from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl

from fourpole import quantities as q
from fourpole.answer import Answer
from fourpole.app import events
from fourpole.app.alike import gathered_alike
from fourpole.app.console import OK, SOME_REJECTED, counted_tests, note, progress, warn
from fourpole.app.options import RunOptions, Wanted
from fourpole.app.standing import (
    STATEMENT,
    Outcome,
    answer_of,
    forget,
    identities,
    note_standing,
    results_of,
    settings_of,
)
from fourpole.campaign import Campaign, read_campaign
from fourpole.core.checks import Code, Verdict, worst_verdict
from fourpole.core.phasor import CHANNELS
from fourpole.errors import CampaignError, FourpoleError
from fourpole.findings.list import checks_by_point, kind_of
from fourpole.fitting.rows import keys_of, seconds_of_fits
from fourpole.io.child import SECONDS
from fourpole.io.documents import json_of
from fourpole.io.door import read_bytes, sha256_of
from fourpole.io.folders import check_no_way_out, is_for_keeping
from fourpole.io.published import LIST, Published, is_complete, published, publishing, without_list
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.quantities import CODE, STORAGE
from fourpole.words import remark_of

if TYPE_CHECKING:
    from fourpole.study.points import Points
    from fourpole.study.study import Study


#: Models are fitted without being asked for if that takes no longer than this [s].
_FEW_SECONDS = 5.0
_MOST_LISTED = 12
#: Verdicts whose reasons are printed; what is printed in their place where K* is ok, and no passive K2 and C exist.
_SAID, _NO_ARM = (Verdict.REJECTED, Verdict.WARNING), "without K2 and C"
#: Checks that another run may pass with the same files, so that their results do not stand.
_PASSING = {code.text for code in (Code.READER, Code.SLOW, Code.MEMORY, Code.FAULT)}


def run_analysis(
    campaign: Path,
    folder: Path | None,
    route: str,
    monte_carlo: int,
    options: RunOptions,
    wanted: Wanted,
    *,
    as_json: bool,
) -> Answer:
    """Analyse a campaign and write its results; the exit code is `SOME_REJECTED` if tests were rejected.

    Doubts about the statement are printed before the work, but for programs.
    """
    settings = settings_of(route, monte_carlo, wanted)
    study, outcome = _outcome(campaign, results_of(campaign, folder), settings, options, wanted, silent=as_json)
    return answer_of(outcome, said=len(study.campaign_there().doubts))


def _outcome(
    campaign: Path,
    results: Path,
    settings: dict[str, Any],
    options: RunOptions,
    wanted: Wanted,
    *,
    silent: bool = False,
) -> tuple[Study, Outcome]:
    """Analyse a campaign, write its results, and note that they stand for these settings.

    Doubts about the statement are printed before the work, unless `silent`.
    """
    forget(campaign, results)
    inputs = identities(campaign, list(STATEMENT))
    stated = read_campaign(campaign)
    warn(*(() if silent else stated.doubts))
    inputs |= identities(campaign, _files_of(stated))
    study = _analysed(stated, results, settings["route"], settings["monte_carlo"], options)
    page = _written(study, results, wanted)
    from fourpole.app.summary import limit_lines, summary_lines  # here, so that a wrong name is said at once
    from fourpole.findings.conformity import conformity_rows, judged

    held = judged(study)
    lines = [f"results: {results}", *([f"report: {page}"] if page is not None else [])]
    outcome = Outcome(
        notes=[*(f"warning: {doubt}" for doubt in stated.doubts), *_notes(study)],
        lines=[
            *summary_lines(study),
            *limit_lines(study, held),
            f"{counted_tests(study.counts)} (route: {study.route})",
            *lines,
        ],
        document={
            **_summary(study, results),
            **({"limits": conformity_rows(held)} if held else {}),
            "report": str(page) if page else None,
        },
        code=SOME_REJECTED if study.counts[Verdict.REJECTED] else OK,
    )
    hashes = study.sha256
    read = all(one is None or name in hashes for name, one in inputs.items())
    if read and is_complete(results) and not _PASSING.intersection(study.checks[CODE.head].to_list()):
        note_standing(campaign, results, settings, inputs, hashes, outcome)
    return study, outcome


def _files_of(campaign: Campaign) -> list[str]:
    """The files that an analysis reads, as tests.csv and campaign.toml name them."""
    channels = [campaign.stated.channels.named(role) for role in CHANNELS]
    responses = [one.response for one in channels if one is not None]
    files = (*(test.file for test in campaign.tests), *responses, campaign.stated.report.logo)
    return list(dict.fromkeys(filter(None, files)))


def run_demo(folder: Path = Path("fourpole-demo"), seed: int = 1982, workers: int | None = None) -> Answer:
    """Simulate a campaign and analyse it: its findings; exit code `SOME_REJECTED` if tests were rejected.

    The results stand for an analysis with default settings, which keeps the models of the folder.
    """
    from fourpole.app.summary import summary_lines
    from fourpole.findings import findings
    from fourpole.report.words.sentence import headline
    from fourpole.study import DRAWS
    from fourpole.virtual import simulate_campaign
    from fourpole.virtual.simulate import demo_settings

    with progress("recording") as advance:
        simulate_campaign(folder, seed=seed, progress=advance, **demo_settings())
    settings = settings_of("joint", DRAWS, Wanted())
    options, wanted = RunOptions(workers=workers), Wanted(models=True)
    study, outcome = _outcome(folder, results_of(folder, None), settings, options, wanted)
    first = next(iter(study.dynamic["tyre"]), None)
    fit = "fit" if all(one.fits for one in study.rigs) else "do not fit"
    made = f"Virtual campaign in {folder} (seed {seed}): {counted_tests(study.counts)}"
    lines = [
        f"{made}; rig and sensors {fit} their statement.",
        *summary_lines(study, of=first),
        "The 1982 paper's two tyres stand behind it; its conclusions hold by design: the report compares them.",
        f"report: {results_of(folder, None) / 'report.html'}; to see it: fourpole open {folder}",
    ]
    return Answer(lines, lambda: {**outcome.document, "found": headline(findings(study))}, code=outcome.code)


def run_simulate(
    folder: Path, seed: int = 1982, clean: bool = False, car: bool = False, massless: bool = False
) -> Answer:
    """Record a campaign on the virtual rigs: the tyre of the car, or those of the paper with or without belts."""
    from fourpole.virtual import BELTED, CAR_TYRE, CROSS_PLY, RADIAL_PLY, simulate_campaign

    if car and massless:
        raise CampaignError("--car and --massless contradict each other: the car's tyre is there for its belt")
    plan: dict[str, Any] = {"tyres": (CROSS_PLY, RADIAL_PLY) if massless else BELTED}
    if car:
        plan = {"tyres": [CAR_TYRE], "preloads": [1000.0], "added_masses": (0.0, 10.0), "eccentricity": 0.2e-3}
    with progress("recording") as advance:
        made = simulate_campaign(folder, seed=seed, clean=clean, progress=advance, **plan)
    files = sorted(str(path) for path in made.folder.rglob("*") if path.is_file())
    return Answer(
        [f"{made.tests} tests recorded in {made.folder} (seed {made.seed}); next: fourpole analyse {made.folder}"],
        lambda: {"folder": str(made.folder), "seed": made.seed, "tests": made.tests, "files": files},
    )


def _analysed(stated: Campaign, results: Path, route: str, monte_carlo: int, options: RunOptions) -> Study:
    from fourpole.study import analyse  # after the campaign is read, so that a wrong name is said at once

    if results == stated.folder / "results":
        check_no_way_out(stated.folder)
    if results.exists() and not results.is_dir():
        raise CampaignError(f"{results}: is a file: name a folder for the results with --out")
    cache = results / "cache"
    if not is_for_keeping(cache, stated.folder):
        note(f"{cache} is a file or a link, or is led to by one: nothing is kept there for a second run")
    with _executor(options) as executor, progress("analysing") as advance:
        return analyse(
            stated,
            route=route,
            monte_carlo=monte_carlo,
            cache=cache,
            verify=options.verify,
            workers=options.workers,
            executor=executor,
            time_limit=options.time_limit or SECONDS,
            progress=advance,
            arrived=_tell if events.wanted() else None,
        )


def _tell(test: str, points: Points) -> None:
    """The verdict on a recording by itself, as an event."""
    checks = [check for row in points.checks for check in row]
    said = {remark_of(check): None for check in checks if check.verdict is not Verdict.OK}
    events.tell(test=test, verdict=worst_verdict([check.verdict for check in checks]), remarks=list(said))


def _executor(options: RunOptions) -> AbstractContextManager[Executor | None]:
    """The executor of the cluster that is named; None for the processes of this machine."""
    if options.scheduler is None:
        return nullcontext()
    if options.workers is not None:
        raise CampaignError("--workers and --scheduler contradict each other: the cluster has its own workers")
    from fourpole.study.cluster import cluster

    return cluster(options.scheduler)


def _written(study: Study, results: Path, wanted: Wanted) -> Path | None:
    """Write tables, model, figures and report, all together or none; returns the report, or None without one.

    With tables only, figures and report of other tables are deleted.
    """
    from fourpole.findings import findings, findings_table
    from fourpole.io.folders import make_folder
    from fourpole.study.tables import TABLE_FILES

    obsolete = [*TABLE_FILES, "findings.csv"]
    with publishing(make_folder(results), obsolete) as new:
        study.write_into(new, results, {"findings": findings_table(findings(study))})
        if not wanted.tables_only:
            obsolete += _files_of_report()
            from fourpole.app.report import make_report  # loads the rooms of figures and words, which takes a second

            modelled = _modelled(study, new, results, obsolete, wanted.models)
            return results / make_report(modelled, new, png=wanted.png).name
        drawn = any(results.glob("report*.html")) or (results / "figures").exists()
        if drawn and not _same(new, results):
            obsolete += _files_of_report()
    return None


def _modelled(tables: Study, new: Path, results: Path, obsolete: list[str], wanted: bool | None) -> Study:
    """The results with the models that are wanted: fitted now, or those that the folder has of the same tables.

    If `wanted` is None, models are fitted if the folder has none of these tables and the fits take a few seconds. A
    model file of other tables goes.
    """
    from fourpole.study.results import with_models

    former = Published(results, {})
    with suppress(FourpoleError):
        former = published(results)
    sha256 = sha256_of(new / "dynamic.csv", max_bytes=MAX_FILE_BYTES)
    kept = with_models(tables, former, sha256, ["map"])
    kept = replace(kept, models=with_models(tables, former, sha256, ["model"]).models)  # one of other tables goes
    empty = tables.dynamic.is_empty() or tables.dynamic[STORAGE.head].is_null().all()
    seconds = seconds_of_fits(tables.dynamic.height)
    fits = not empty and (wanted or (wanted is None and kept.models is None and seconds <= _FEW_SECONDS))
    if empty or fits or kept.models is None:
        obsolete.append("model.json")
    if fits:
        from fourpole.app.models import fitted

        return fitted(kept, new)
    if kept.models is None and not empty:
        note(f"no models (about {seconds:.0f} s): fourpole fit {results}, then fourpole report {results}")
    return kept


def _files_of_report() -> tuple[str, ...]:
    """The files of the report, and the pages of standards, which are of the former tables."""
    from fourpole.app.report import OF_REPORT
    from fourpole.report.standards import PAGES

    return (*OF_REPORT, *PAGES.values())


def _same(new: Path, former: Path) -> bool:
    """Whether the tables of the former results are the new ones, to the last bit, and so is what was stated."""
    with suppress(FourpoleError):
        was = published(former)
        now = json_of(read_bytes(new / LIST, max_bytes=MAX_FILE_BYTES), LIST)
        origins = ({**without_list(record), "origin": None} for record in (was.record, now))
        names = [path.name for path in new.iterdir() if path.name != LIST]
        tables = all(
            was.has(name) and was.sha256(name) == sha256_of(new / name, max_bytes=MAX_FILE_BYTES) for name in names
        )
        return tables and next(origins) == next(origins)
    return False


def _verdicts(study: Study) -> pl.DataFrame:
    """Test, verdict and remarks of every row of both tables; `_NO_ARM` where K* is ok, and K2 and C do not exist."""
    verdict, arm = pl.col(q.VERDICT.head), pl.col(q.VERDICT_ARM.head)
    lost = pl.when((verdict == Verdict.OK) & (arm == Verdict.REJECTED)).then(pl.lit(_NO_ARM)).otherwise(verdict)
    dynamic = study.dynamic.with_columns(lost.alias(q.VERDICT.head))
    return pl.concat([table.select("test", "verdict", "remarks") for table in (study.static, dynamic)])


def _notes(study: Study) -> list[str]:
    """The remarks of the tests that are rejected or have a warning, then notes and assumptions."""
    notes, checks = [], checks_by_point(study.checks)
    keys = [key for table in (study.static, study.dynamic) for key in keys_of(table)]
    rows = dict(zip(_verdicts(study).rows(), keys, strict=True))
    for verdict, of_check in (*((each, each) for each in _SAID), (_NO_ARM, Verdict.REJECTED)):
        kinds = gathered_alike(
            (name, kind_of([check for check in checks.get(key, ()) if check.verdict == of_check], text), text)
            for (name, holds, text), key in rows.items()
            if holds == verdict
        )
        notes += [f"{verdict}: {one.tests}: {one.text}" for one in kinds[:_MOST_LISTED]]
        if more := sum(len(one.names) for one in kinds[_MOST_LISTED:]):
            notes.append(f"... and {more} more with verdict {verdict}; see the tables")
    return [*notes, *(f"note: {note}" for note in study.notes)]


def _summary(study: Study, results: Path) -> dict[str, Any]:
    rejected = _verdicts(study).filter(pl.col("verdict") == Verdict.REJECTED)
    return {
        "results": str(results),
        "route": study.route,
        "verdicts": study.counts,
        "rejected": rejected.select("test", "remarks").to_dicts(),
        "assumptions": list(study.assumptions),
        "notes": [note for note in study.notes if note not in study.assumptions],
    }
