"""The commands that hold results, model files and this installation against what they should be."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from fourpole.answer import Answer, Part, Table
from fourpole.app.console import OK, SOME_REJECTED, UNREADABLE, counted, more, progress, say, warn
from fourpole.app.model_words import put_back_shown
from fourpole.errors import FileError, FourpoleError
from fourpole.findings import findings, findings_table
from fourpole.fitting.modelfile import MapEntry, ModelEntry, ModelFile
from fourpole.fitting.modelparts import EARLIER
from fourpole.fitting.verified import TableState, Verified, seal_later, verify
from fourpole.io.folders import model_in, results_in
from fourpole.io.origin import origin
from fourpole.io.published import write_result
from fourpole.io.write import beside, write_text
from fourpole.report.selftest import (
    Compared,
    SelfTest,
    render_selftest,
    self_test,
    selftest_csv,
    shown_share,
    verdict_of,
)
from fourpole.report.standards import (
    NOTE,
    PAGES,
    Found,
    Requirement,
    Standard,
    answered,
    counts,
    render_standard,
    standard_named,
)
from fourpole.study.repeated import Difference
from fourpole.study.study import Study
from fourpole.study.verified import Match, Proof, Repeated, VerifiedResults, folder_of, verify_results
from fourpole.units import shown
from fourpole.words import first_of

_MOST_SAID = 6
_TABLES = {
    TableState.SAME: "beside it and the same",
    TableState.MISSING: "not beside it, so not compared",
    TableState.UNKNOWN: "not known",
}


def run_verify(
    path: Path,
    quick: bool = False,
    campaign: Path | None = None,
    workers: int | None = None,
    copy: Path | None = None,
    as_json: bool = False,
) -> Answer:
    """Verify results, or a model file, and say what was found."""
    if copy is None and (path.is_dir() or path.name == "study.json"):
        return _results_verified(folder_of(path) or results_in(path), campaign, quick=quick, workers=workers)
    return _model_verified(model_in(path), copy, as_json=as_json)


def _model_verified(path: Path, copy: Path | None, *, as_json: bool) -> Answer:
    """What a model file holds; with `copy`, a file that has no seal is sealed first."""
    if copy is not None:
        seal_later(path, copy)
        say(f"written: {copy}")
        path = copy
    try:
        found = verify(path)
    except FourpoleError as error:
        if not as_json:
            raise
        said = str(error)
        return Answer((), lambda: {"file": str(path), "good": False, "error": said}, code=UNREADABLE)
    return Answer(_show_model(path, found), lambda: _model_document(path, found))


def _model_document(path: Path, found: Verified) -> dict[str, Any]:
    file, origin = found.file, found.file.provenance
    return {
        "file": str(path),
        "good": True,
        "kind": file.kind,
        "version": file.version,
        "written": found.written or None,
        "fourpole": origin.fourpole,
        "table": {"source": origin.source, "sha256": origin.sha256, "state": found.table.value},
        "settings": origin.settings,
        "notes": origin.notes,
        "entries": [
            {
                "tyre": one.tyre,
                "model": one.model,
                "causal": one.causal,
                "conditions": _conditions(one),
                "band [Hz]": _band(one),
                "put back": None if one.put_back is None else one.put_back.model_dump(),
            }
            for one in _entries(file)
        ],
    }


def _entries(file: ModelFile) -> list[ModelEntry | MapEntry]:
    return [*file.models, *file.maps]


def _conditions(one: ModelEntry | MapEntry) -> int:
    if isinstance(one, ModelEntry):
        return len(one.conditions)
    return len(one.axes[0].values) if one.axes else 1


def _band(one: ModelEntry | MapEntry) -> tuple[float, float] | None:
    """Lowest and highest frequency of an entry [Hz]."""
    if not isinstance(one, ModelEntry):
        return one.band
    bands = [each.band for each in one.conditions]
    return (min(low for low, _ in bands), max(high for _, high in bands)) if bands else None


def _show_model(path: Path, found: Verified) -> Iterator[Part]:
    origin = found.file.provenance
    when = f" on {found.written.replace('T', ' ').replace('Z', ' UTC')}" if found.written else ""
    yield f"{path}: as it was written{when}, by Fourpole {origin.fourpole}"
    for one in _entries(found.file):
        count, band = _conditions(one), _band(one)
        what = "map" if isinstance(one, MapEntry) else "model"
        many = f"{count} condition{'s' * (count != 1)}"
        over = f", over {first_of([axis.name for axis in one.axes], _MOST_SAID)}" if isinstance(one, MapEntry) else ""
        where = f", {band[0]:.4g} to {band[1]:.4g} Hz" if band else ""
        yield f"{what:<9} {' '.join(filter(None, (one.tyre, one.model)))}: {many}{over}{where}"
        yield from put_back_shown(one.put_back)
    if found.table is TableState.CHANGED:
        yield f"table     {origin.source}: another one is beside it now"
        warn(f"{origin.source} has changed since the model was made: fit or map again for a model of it")
    elif origin.source:
        yield f"table     {origin.source}: {_TABLES[found.table]}"
    if origin.sha256:
        yield f"SHA-256   {origin.sha256} of that table"
    own = {name: value for name, value in origin.settings.items() if name != EARLIER}
    if own:
        yield f"settings  {_in_words(own)}"
    for tyre, settings in list(origin.earlier.items())[:_MOST_SAID]:
        yield f"earlier   {shown(tyre)}: {_in_words(settings)}"
    yield from (f"note      {note}" for note in origin.notes)


def _in_words(settings: Any) -> str:
    """The first options and their values."""
    named = settings.items() if isinstance(settings, dict) else ()
    return first_of([f"{name} {value}" for name, value in named], _MOST_SAID)


_MOST_NAMED = 8
#: What is wrong with a file, in words, and what to do.
_WRONG = {
    Match.CHANGED: "has changed since",
    Match.MISSING: "is not there",
    Match.ADDED: "was not written with these results",
}


def _results_verified(folder: Path, campaign: Path | None, *, quick: bool, workers: int | None) -> Answer:
    """What is the same of results; the exit code says whether all, a part or nothing of it is good."""
    with progress("analysing again") as advance:
        found = verify_results(
            folder,
            campaign,
            quick=quick,
            workers=workers,
            further=lambda study: {"findings": findings_table(findings(study))},
            progress=advance,
        )
    code = UNREADABLE if not found.good else OK if found.complete else SOME_REJECTED
    return Answer(_show_results(found), lambda: _results_document(found), code=code)


def _show_results(found: VerifiedResults) -> Iterator[Part]:
    by = f"Fourpole {found.made_by}" if found.made_by else "a Fourpole that does not say its version"
    commit = f" (commit {found.commit[:12]})" if found.commit else ""
    yield f"{found.folder}: results of {by}{commit}"
    yield from _show_files("inputs", found.inputs, "read", named=found.campaign is not None)
    yield from _show_files("results", found.results, "written")
    yield from _show_files("models", found.models, "written, of these tables")
    yield from _show_repeated(found)
    yield ""
    if found.good and found.complete:
        yield "Verified." if not found.quick else "Verified by hashes alone; without --quick the analysis is run again."
    elif found.good:
        yield f"Nothing contradicts the results, but not all could be checked: {_unknown(found)}."
    else:
        yield "Not verified."


def _show_files(head: str, files: Sequence[Proof], done: str, *, named: bool = True) -> Iterator[Part]:
    """The state of all files of a kind in one line, and of each that is not as it was in one more, if `named`."""
    if not files:
        return
    count = Counter(file.state for file in files)
    good = count[Match.SAME]
    parts = (
        [f"{good} of {counted(len(files), 'file')} as {'it was' if good == 1 else 'they were'} {done}"] if good else []
    )
    parts += [f"{number} {state.value}" for state, number in count.items() if state is not Match.SAME]
    yield f"{head:<10}{', '.join(parts)}"
    for state, text in _WRONG.items() if named else ():
        _warn_of([file for file in files if file.state is state], text)


def _warn_of(files: Sequence[Proof], text: str) -> None:
    for file in files[:_MOST_NAMED]:
        warn(file.why if file.why.startswith(f"{file.name}: ") else f"{file.name}: {file.why or text}")
    warn(*more(files, _MOST_NAMED, f": {text}"))


def _show_repeated(found: VerifiedResults) -> Iterator[Part]:
    if found.not_run:
        yield f"run again not done: {found.not_run}"
        return
    bad = [one for one in found.repeated if one.differences]
    bits = sum(one.bits for one in found.repeated)
    rounded = len(found.repeated) - bits - len(bad)
    parts = [f"{counted(bits, 'table')} the same to the last bit"] if bits else []
    parts += [f"{rounded} the same within round-off"] if rounded else []
    parts += [f"{len(bad)} not the same"] if bad else []
    yield f"run again {', '.join(parts)}, by Fourpole {origin().text}"
    for one in bad:
        said = [*map(_sentence, one.differences[:_MOST_NAMED]), *more(one.differences, _MOST_NAMED, " columns")]
        warn(*(f"{one.name}: {sentence}" for sentence in said))
    if bad and found.other_version:
        warn(
            f"the results were written by version {found.made_by or 'unknown'}: the difference may be that of the "
            "versions; verify them with that one"
        )


def _sentence(each: Difference) -> str:
    """A difference in words: column, test, both cells, and the size."""
    if not each.column:
        rows = f"{each.count} rows, as {each.row}: " if each.count > 1 else f"{each.row}: " if each.row else ""
        return f"{rows}{each.was} as written, {each.now} in the second run"
    where = f" in {each.row}" if each.row else ""
    more = f" ({each.count} rows differ, this one most)" if each.count > 1 else ""
    size = f", by {each.size:.3g}" if each.size == each.size else ""
    return f"{each.column}{where}: {each.was} as written, {each.now} in the second run{size}{more}"


def _unknown(found: VerifiedResults) -> str:
    """What could not be checked, in words."""
    parts = [found.not_run] if found.not_run and not found.quick else []
    files = [one for one in found.unknown if one not in found.inputs or (found.campaign is not None and not parts)]
    for state, text in (
        (Match.MISSING, "not there"),
        (Match.ELSEWHERE, "on a server"),
        (Match.UNKNOWN, "without a hash, because an earlier version wrote them"),
    ):
        names = [one.name for one in files if one.state is state]
        if names and not any(text in part for part in parts):
            parts.append(f"{first_of(names, 3)} {text}")
    return "; ".join(parts)


def _results_document(found: VerifiedResults) -> dict[str, Any]:
    """The verification for programs."""
    return {
        "results": str(found.folder),
        "campaign": str(found.campaign) if found.campaign else None,
        "good": found.good,
        "complete": found.complete,
        "made_by": {"version": found.made_by or None, "commit": found.commit or None},
        "run_by": origin().record,
        "inputs": [vars(one) for one in found.inputs],
        "tables": [vars(one) for one in found.results],
        "models": [vars(one) for one in found.models],
        "not_run": found.not_run or None,
        "run_again": [_table(one) for one in found.repeated],
    }


def _table(one: Repeated) -> dict[str, Any]:
    return {
        "table": one.name,
        "same": not one.differences,
        "same_bits": one.bits,
        "differences": [vars(each) for each in one.differences],
    }


_REQUIREMENT_HEADS = ("requirement", "clause", "measured", "limit", "answer")


def run_standard(results: Study, folder: Path, name: str) -> Answer:
    """The requirements of a standard with their answers; writes its page beside the report."""
    standard = standard_named(name)
    found, page = answered(standard, results), folder / PAGES[standard.key]
    write_result(page, render_standard(standard, results).encode(), basis=results.dynamic_sha256)
    parts: list[Part] = [
        standard.title,
        Table(
            _REQUIREMENT_HEADS, [(one.text, one.place, item.text, one.limit, item.answer.value) for one, item in found]
        ),
        "",
        ", ".join(f"{count} {answer.value}" for answer, count in counts(found).items()),
        *standard.terms,
        NOTE,
        f"page: {page}",
    ]
    return Answer(parts, lambda: _standard_document(standard, found, results, page))


def _standard_document(
    standard: Standard, found: list[tuple[Requirement, Found]], results: Study, page: Path
) -> dict[str, Any]:
    """The answers for programs."""
    values = standard.values(results)
    return {
        "standard": standard.key,
        "title": standard.title,
        "requirements": [
            {
                "key": one.key,
                "clause": one.clause,
                "read": one.read,
                "requirement": one.text,
                "limit": one.limit,
                "source": one.source,
                "measured": item.text,
                "answer": item.answer.value,
            }
            for one, item in found
        ],
        "terms": list(standard.terms),
        "values": [dict(zip(values.heads, row, strict=True)) for row in values.rows],
        "page": str(page),
    }


_ENDINGS = (".html", ".htm")
_CHECK_HEADS = ("check", "values", "difference over tolerance", "verdict")
_MOST_FAILED = 12


def run_selftest(file: Path | None = None, laboratory: str = "", operator: str = "") -> Answer:
    """Run the self-test and write page and table; exit code `SOME_REJECTED` if a value fails."""
    if file is not None and file.suffix.lower() not in _ENDINGS:
        raise FileError(f"{file}: the page is HTML: name a file that ends in .html; a table is written beside it")
    with progress("checking") as advance:
        test = self_test(advance)
    files = _page_written(test, file, laboratory, operator) if file is not None else []
    written = [("written", path) for path in files]
    return Answer(_show(test), lambda: _selftest_document(test, files), written, OK if test.good else SOME_REJECTED)


def _page_written(test: SelfTest, page: Path, laboratory: str, operator: str) -> list[Path]:
    """Write the page, and the table of the same name beside it."""
    table = page.with_suffix(".csv")
    with beside(table) as new:
        write_text(new, selftest_csv(test))
        write_text(page, render_selftest(test, laboratory, operator))
    return [page, table]


def _show(test: SelfTest) -> Iterator[Part]:
    rows = [(one.check, str(one.count), shown_share(one.largest), verdict_of(not one.bad)) for one in test.summaries]
    yield Table(_CHECK_HEADS, rows, right=_CHECK_HEADS[1:3])
    bad = [one for one in test.values if not one.good]
    warn(*(f"{one.check}: {one.function}, {one.value}: {_difference(one)}" for one in bad[:_MOST_FAILED]))
    warn(*more(bad, _MOST_FAILED))
    yield ""
    passed = f"{len(test.values)} values, all pass" if test.good else f"{len(bad)} of {len(test.values)} values fail"
    yield f"Fourpole {test.origin.text}: {passed}"


def _difference(one: Compared) -> str:
    """What was expected and found of a value that fails."""
    if one.difference is None:
        return f"expected {one.expected}, found {one.found}"
    unit = f" {one.unit}" if one.unit not in ("", "1") else ""
    return f"differs by {one.difference:.3g}{unit}, tolerance {one.tolerance:.2g}"


def _selftest_document(test: SelfTest, files: list[Path]) -> dict[str, Any]:
    """The test for programs."""
    return {
        "good": test.good,
        "fourpole": test.origin.record,
        "when": test.when.isoformat(timespec="seconds"),
        **{name: getattr(test, name) for name in ("machine", "system", "python", "packages", "sha256")},
        "checks": [
            {"check": one.check, "values": one.count, "failed": one.bad, "largest": one.largest}
            for one in test.summaries
        ],
        "failed": [vars(one) for one in test.values if not one.good],
        "files": [str(path) for path in files],
    }
