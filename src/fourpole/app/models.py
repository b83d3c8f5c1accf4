"""The commands on models: fit, causality, map and query."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl

from fourpole import quantities as q
from fourpole import units
from fourpole.answer import Answer, Part
from fourpole.app.console import frequencies, note, option, progress, say, warn
from fourpole.app.group import rows_answer
from fourpole.app.model_words import put_back_shown, show_fit, show_map, show_row
from fourpole.app.options import DataOptions, FitOptions, Purpose, RigOptions, Selection, answered_in
from fourpole.core.digits import number
from fourpole.errors import CampaignError, FourpoleError, ModelError, UnitError
from fourpole.fitting.mapping import channel_hint
from fourpole.fitting.measured import Measured, MeasuredSet, read_measured, table_of
from fourpole.fitting.modelfile import ModelFile, read_model_file
from fourpole.fitting.modelling import fit_tyres, lacking_error, map_tyres, model_file
from fourpole.fitting.overtime import fit_over_time
from fourpole.fitting.query import INTERVAL, Query, ask
from fourpole.fitting.shifting import laws_beside
from fourpole.fitting.stated import rig_file, shapes_in
from fourpole.fitting.static import FACTOR_STD, join_static
from fourpole.fitting.verified import renewed
from fourpole.io.folders import model_in, results_in
from fourpole.io.published import published_beside, publishing
from fourpole.models.families import BELT, automatic, by_amplitude, model_named, sizes_of
from fourpole.models.inertial import Of
from fourpole.models.ladder import Rung, Verdict, verdict_of
from fourpole.quantities import ShownUnits
from fourpole.report.models import kind_that_holds, lie_in_words
from fourpole.study.record import units_beside
from fourpole.words import first_of

if TYPE_CHECKING:
    from fourpole.study.study import Study

#: Relative uncertainty of K* for a verdict if the table states none.
_ASSUMED = 0.01
_MOST_NAMED = 12
#: Options of `fit` that a table over time does not take.
_NOT_OVER_TIME = ("over", "band", "k1", "fix", "share", "static", "figure")
#: Figures of a folder that show the models or the maps of it; others do not change with these.
SHOWING = {
    "model": ("first-stiffness", "first-tr", "stiffness", "storage-loss", "arm", "tr", "pressure-frequency",
              "model-choice", "spectrum", "amplitude"),
    "map": ("map",),
}  # fmt: skip
#: Figures that not every model has, written beside the first one.
_FURTHER = ("spectrum", "amplitude")


def _read(path: Path, data: DataOptions, assumed: float | None = None, model: str = "") -> MeasuredSet:
    """K* of the chosen conditions; `assumed` is its relative uncertainty if no option states one."""
    std = assumed if data.std is None else option(data.std, "ratio", "--std")
    if std is not None and not 0 < std < 1:
        raise UnitError("--std: the uncertainty of K* must lie between 0 and 100 %")
    moved = by_amplitude(model)
    found = read_measured(
        path, over=data.over or (), std=std, k1=_static(data), by_amplitude=moved, options=data.table(), of=_of(data.of)
    )
    return found.only(data.tyre, None if data.band is None else _band(data.band))


def _of(text: str | None) -> Of | None:
    """What K* is of, by the option ``--of``."""
    if text is not None and text not in [one.value for one in Of]:
        raise UnitError(f"--of: {units.shown(text)} is none of {', '.join(one.value for one in Of)}")
    return None if text is None else Of(text)


def _settings(model: str, options: DataOptions) -> dict[str, Any]:
    """The options that were given, as a model file states them."""
    given = {name: value for name, value in asdict(options).items() if value and name not in ("file", "figure")}
    return {"model": model, **given}


def _static(data: DataOptions) -> tuple[float, float] | None:
    """Static stiffness of the options and its standard uncertainty [N/m]."""
    if data.k1 is None:
        if data.std_k1 is not None:
            raise UnitError("--std-k1 is of --k1: state both")
        return None
    k1 = option(data.k1, "stiffness", "--k1", "positive")
    return k1, k1 * option(data.std_k1 or "2 %", "ratio", "--std-k1")


def _with_static(measured: MeasuredSet, path: Path, options: FitOptions) -> MeasuredSet:
    """The conditions with K1 as ``--static`` states it: at rest, or as the tangent of a ramp."""
    if options.static not in (None, "rest", "ramp"):
        raise UnitError(f"--static: {units.shown(str(options.static))} is neither rest nor ramp")
    if options.static != "ramp":
        if options.std_static is not None:
            raise UnitError("--std-static is of --static ramp: state both")
        return measured
    if options.k1 is not None:
        raise UnitError("--k1 states no time: --static ramp takes K1 of the static tests; state one of the two")
    if options.share:
        raise UnitError("--share takes K1 at rest: state --share or --static ramp")
    std = FACTOR_STD if options.std_static is None else option(options.std_static, "ratio", "--std-static")
    if not 0 <= std <= 1:
        raise UnitError("--std-static: the uncertainty of the factor must lie between 0 and 100 %")
    return join_static(measured, path, std)


def _band(text: str) -> tuple[float, float]:
    """Lowest and highest frequency [Hz] of the option ``--band``."""
    try:
        return units.frequency_band(text)
    except UnitError as error:
        raise UnitError(f"--band: {error}") from None


def run_fit(results: Path, model: str = "auto", *, options: FitOptions) -> Answer:
    """Fit or choose a model for each tyre; write the model file."""
    path = results_in(results)
    if path.is_file() and (answer := _fit_over_time(path, model, options)):
        return answer
    measured = _with_static(_read(path, options, model=model), path, options)
    note(*measured.notes)
    with progress("fitting") as advance:
        fixed = _fixed(options.fix or (), model)
        fits = fit_tyres(measured, model, given=fixed, share=options.share or (), progress=advance)
    laws, doubt = laws_beside(path, measured.sha256)
    if doubt:
        warn(doubt)
    made = model_file(measured, fits, settings=_settings(model, options), laws=laws, **_stated(path, measured, options))
    file = _elsewhere(path, made, options.file)
    files = _written(path, measured, made, file, options.figure)

    def then() -> Iterator[Answer]:
        yield from _renew_report(path, file)
        if any(one.stopped for one in fits):
            raise KeyboardInterrupt  # the exit code says so; what was found is written

    return Answer(_shown(made, units_beside(path)), lambda: made.document, files, then=then)


def _fit_over_time(path: Path, model: str, options: FitOptions) -> Answer | None:
    """Fit a table of relaxation or creep and write the model file; None for another table."""
    std = None if options.std is None else option(options.std, "ratio", "--std", "positive")
    settings = _settings(model, options)
    made = fit_over_time(path, model, options.table(), std=std, tyre=options.tyre, settings=settings)
    if made is None:
        return None
    if given := [name for name in _NOT_OVER_TIME if getattr(options, name)]:
        raise UnitError(f"{path.name} is over time: leave out {', '.join(f'--{name}' for name in given)}")
    note(*made.provenance.notes)
    if options.file is not None:
        made.write(options.file)
    files = [] if options.file is None else [("written", options.file)]
    return Answer(_shown(made, ShownUnits()), lambda: made.document, files)


def _shown(made: ModelFile, wanted: ShownUnits) -> Iterator[Part]:
    """The content of a model file."""
    for entry in made.models:
        yield from show_fit(entry, wanted, shared="share" in made.provenance.settings)
    for one in (*made.models, *made.maps):
        yield from put_back_shown(one.put_back, one.tyre if len(made.tyres) > 1 else "")


def fitted(results: Study, folder: Path) -> Study:
    """The results with a model chosen for each tyre, which is also written to model.json in `folder`."""
    target = folder / "model.json"
    try:
        measured = read_measured(folder)
        with progress("choosing models") as advance:
            made = model_file(
                measured,
                fit_tyres(measured, progress=advance),
                settings={"model": "auto"},
                rig=rig_file(results.record, results.rig),
                shapes=shapes_in(results.record),
            )
    except ModelError as error:
        note(f"no model was fitted: {error}")
        target.unlink(missing_ok=True)
        return results
    for one in made.models:
        say(*map(str, put_back_shown(one.put_back, one.tyre)))
    made.write(target)
    return replace(results, models=made)


def run_causality(results: Path, data: DataOptions) -> Answer:
    """The smallest kind of passive linear specimen that can have K* of each condition."""
    path = results_in(results)
    measured = _read(path, data)
    if measured.known:
        note(*measured.notes)
    else:
        warn(f"the table states no uncertainty of K*: taken as {100 * _ASSUMED:g} %; state --std")
        measured = _read(path, data, _ASSUMED)
    found = [(one, verdict_of(one.data, one.of)) for one in measured.conditions]

    def document() -> dict[str, Any]:
        rows = [{"tyre": one.tyre, "state": one.state, **_verdict(one, verdict)} for one, verdict in found]
        return {"source": measured.source, "conditions": rows}

    return Answer(_verdicts_shown(found, measured.source, units_beside(path)), document)


def _verdicts_shown(found: Sequence[tuple[Measured, Verdict]], source: str, wanted: ShownUnits) -> Iterator[Part]:
    """The verdict on each condition, and what to do where K* is not possible."""
    for one, verdict in found:
        where = " at ".join(part for part in (one.tyre, one.in_words(wanted)) if part) or source
        yield from _show_verdict(where, one, verdict)
    bad = sum(not verdict.possible for _, verdict in found)
    yield f"{len(found) - bad} of {len(found)} conditions are possible"
    if bad:
        say(
            "either the tests are at fault (a gain, a resonance, a specimen that had not settled), or their "
            "uncertainty is too small, or the specimen is not linear, or it has more inertia than these rungs; "
            "fourpole rig says what the rig explains"
        )
        if hint := channel_hint(*zip(*found, strict=True)):
            say(hint)


def _show_verdict(where: str, one: Measured, verdict: Verdict) -> Iterator[Part]:
    chi2 = f"(chi-square {number(verdict.chi2)} for {verdict.dof} degrees of freedom, p-value {verdict.chance:.2g})"
    yield f"{where}: {kind_that_holds(verdict)} {chi2}"
    if verdict.holds is Rung.NONE:
        yield f"  {_contradicting(verdict, one.own.count)}"
        error = 100 * lacking_error(one, verdict)
        yield f"  K* would be possible with an uncertainty of {error:.2g} % at each frequency"
    yield from (f"  {lie_in_words(lie)}" for lie in verdict.lies)


def run_map(results: Path, model: str = "auto", *, data: Selection, file: Path | None = None) -> Answer:
    """Make the operating map of each tyre, and write the map."""
    path, chosen = results_in(results), DataOptions(**asdict(data))
    measured = _read(path, chosen, model=model)
    note(*measured.notes)
    with progress("mapping") as advance:
        maps = map_tyres(measured, model, data.over or (), progress=advance)
    made = model_file(measured, maps=maps, settings=_settings(model, chosen), **_stated(path, measured, chosen))
    file = _elsewhere(path, made, file)
    files = _written(path, measured, made, file if file is not None or path.is_dir() else Path("map.json"), None)
    parts = chain(*map(show_map, maps), _shown(made, units_beside(path)))
    return Answer(parts, lambda: made.document, files, then=lambda: _renew_report(path, file))


def _renew_report(path: Path, file: Path | None) -> Iterator[Answer]:
    """Make the report of a folder again, if it has one and the model went into the folder."""
    if file is not None or not (path / "report.html").is_file():
        return
    from fourpole.app.report import renew_report
    from fourpole.study.results import read_results

    with _kept("renewed report"):
        renew_report(read_results(path), path)
        yield Answer([f"report: {path / 'report.html'}, renewed with this"])


def run_query(
    model: Path,
    frequency: str,
    pressure: float | None = None,
    preload: float | None = None,
    temperature: float | None = None,
    amplitude: float | None = None,
    at: list[str] | None = None,
    tyre: str | None = None,
    purpose: Purpose | None = None,
    *,
    above: RigOptions,
    beyond: bool = False,
    file: Path | None = None,
    as_json: bool = False,
) -> Answer:
    """Evaluate a model file; one row is shown in lines, several as a table."""
    stated = {q.PRESSURE.head: pressure, q.PRELOAD.head: preload, q.TEMPERATURE.head: temperature}
    stated[q.DEFLECTION_AMPLITUDE.head] = amplitude
    state = {column: value for column, value in stated.items() if value is not None} | _axis_values(at or [])
    path, asked = model_in(model), Query(frequencies(frequency), state, tyre, above.rig, beyond, purpose=purpose)
    wanted = answered_in(units_beside(path), *state.values())
    rows = ask(read_model_file(path), replace(asked, units=wanted))
    warn(*dict.fromkeys(row["remarks"] for row in rows if row["remarks"]))
    frame = pl.DataFrame(rows, infer_schema_length=None)
    if len(rows) == 1 and file is None:
        return Answer(show_row(rows[0], wanted), lambda: {"rows": frame.to_dicts()})
    inside = [] if any(row[q.OUTSIDE.head] for row in rows) else [q.OUTSIDE.head]
    answer = rows_answer(frame, file, wanted, leave_out=(*inside, q.REMARKS.head, INTERVAL))
    if file is not None or not as_json:
        say(str(rows[0][INTERVAL]))
    return answer


def _axis_values(texts: Sequence[str]) -> dict[str, float]:
    """Values of the options ``--at``, by column."""
    state = {}
    for text in texts:
        column, _, value = text.rpartition("=")
        try:
            state[column.strip()] = found = float(value)
        except ValueError:
            found = math.nan
        if not (column and math.isfinite(found)):
            raise UnitError(f"--at: {units.shown(text)} is not a column and a number, as in 'camber [deg] = 2'")
    return state


def _fixed(texts: Sequence[str], model: str) -> dict[str, float]:
    """Fixed parameters by symbol, in SI; only one without dimension may be a bare number."""
    names = automatic() if model in ("auto", BELT) else (model,)
    largest = [f"{name}:{sizes[-1]}" if (sizes := sizes_of(name)) else name for name in names]
    known = {one.symbol: one.unit for name in largest for one in model_named(name).parameters}
    kinds = {units.si_unit(kind): kind for kind in reversed(list(units.KINDS))}  # the first kind of a unit
    found = {}
    for text in texts:
        symbol, mark, value = (part.strip() for part in text.partition("="))
        if not mark or symbol not in known:
            there = ", ".join(list(known)[:_MOST_NAMED])
            raise UnitError(
                f"--fix: {units.shown(text)} is not a parameter and its value, as in 'K1=180 kN/m'; there are {there}"
            )
        unit = known[symbol]
        digits = value.removesuffix(" 1" if unit == "1" else unit)
        try:
            number = float(digits)
        except ValueError:
            if unit not in kinds:
                raise UnitError(f"--fix {symbol}: {units.shown(value)} is not a number in {unit}") from None
            found[symbol] = option(value, kinds[unit], f"--fix {symbol}")
            continue
        if unit != "1" and digits == value:
            usual = "kN/m" if unit == "N/m" else unit
            raise UnitError(f'--fix: {units.shown(text)} has no unit: write --fix "{symbol}={value} {usual}"')
        found[symbol] = number
    return found


def _stated(path: Path, measured: MeasuredSet, data: DataOptions) -> dict[str, Any]:
    """The rig of the tests, for TR, and the shapes of the specimens; of a single table the shape that options state."""
    from fourpole.study.results import read_results

    folder = path if path.is_dir() else path.parent
    try:
        results = read_results(folder)
    except CampaignError:
        shape = data.table().shape
        return {} if shape is None else {"shapes": dict.fromkeys(measured.tyres, shape)}
    return {"rig": rig_file(results.record, results.rig), "shapes": shapes_in(results.record)}


def _elsewhere(path: Path, made: ModelFile, file: Path | None) -> Path | None:
    """The file that ``--out`` states; None if it is the one that the folder of results has without the option."""
    own = file is not None and path.is_dir() and file.resolve() == (path / f"{made.kind}.json").resolve()
    return None if own else file


def _written(
    path: Path, measured: MeasuredSet, made: ModelFile, file: Path | None, figure: Path | None
) -> list[tuple[str, Path]]:
    """Write a model file and, where it is asked for, its figures; returns the files, each after what is said of it.

    The model file goes to `file`, or else into the folder of results if there is one, with the entries that the former
    one has of other tyres of the same table. The figures of the folder that show models are deleted: those of the
    report are drawn with it.
    """
    written = [] if file is None else [file]
    if file is not None:
        (_with_others(file, made) if file.is_file() else made).write(file)
    elif path.is_dir():
        place = path / f"{made.kind}.json"
        made = _with_others(place, made) if published_beside(place).has(place.name) else made
        drawn = [f"figures/{key}.{form}" for key in SHOWING[made.kind] for form in ("svg", "png")]
        with publishing(path, drawn, basis=measured.sha256) as new:
            made.write(new / place.name)
        written = [place]
    if figure is not None:
        written += _drawn(path, measured, made, figure)
    return [("written", place) for place in written]


def _with_others(place: Path, made: ModelFile) -> ModelFile:
    """A document with the entries of other tyres that its file has; one that cannot be used is named and replaced."""
    try:
        whole = renewed(read_model_file(place), made)
    except FourpoleError as error:
        warn(f"the former {place.name} is replaced: {error}")
        return made
    if kept := [tyre for tyre in whole.tyres if tyre not in made.tyres]:
        note(f"{place.name} keeps {first_of([units.shown(one) for one in kept], _MOST_NAMED)} of an earlier fit")
    return whole


def _drawn(path: Path, measured: MeasuredSet, made: ModelFile, file: Path) -> list[Path]:
    """Draw the first figure of a model file into `file`, and those that not every model has beside it."""
    from fourpole.plot import draw, write_figure
    from fourpole.study.results import read_results
    from fourpole.study.study import Study

    results = read_results(path) if path.is_dir() else Study(pl.DataFrame(), table_of(measured), pl.DataFrame())
    results, written = replace(results, models=made), list[Path]()
    for key in ("storage-loss", *_FURTHER):
        one = draw(results, key)
        if one is not None:
            name = file if key == "storage-loss" else file.with_stem(f"{file.stem}-{key}")
            written.append(write_figure(one, key, name))
        elif not written:
            raise ModelError("the model file holds nothing to draw")
    return written


@contextmanager
def _kept(what: str) -> Iterator[None]:
    """Files written before are kept if what follows fails or is stopped; a warning says so."""
    try:
        yield
    except KeyboardInterrupt:
        warn(f"stopped: no {what}; the model file is written")
    except FourpoleError:
        raise
    except Exception as error:  # noqa: BLE001 - a figure must not cost the fits, which may have taken long
        warn(f"no {what} ({type(error).__name__}: {error}); the model file is written")


def _verdict(one: Measured, verdict: Verdict) -> dict[str, Any]:
    return {
        "possible": verdict.possible,
        "chi2": verdict.chi2,
        "dof": verdict.dof,
        "chance": verdict.chance,
        "holds": verdict.holds.value,
        "mass [kg]": verdict.mass,
        "u(mass) [kg]": verdict.mass_std,
        "resonances [Hz]": verdict.resonances.tolist(),
        q.BELT_MASS.head: None if verdict.belt is None or verdict.of is Of.BLOCKED_TRANSFER else verdict.belt.mass,
        q.BELT_MASS.u_head: None if verdict.belt is None else verdict.belt.mass_std,
        "or an error of": [{"of": lie.name, "size": lie.size, "unit": lie.unit} for lie in verdict.lies],
        "possible with an error of [1]": lacking_error(one, verdict),
        "impossible [Hz]": [] if verdict.possible else verdict.relaxing.impossible.tolist(),
        "possible without K1": verdict.relaxing.without_k1,
    }


def _contradicting(verdict: Verdict, count: int) -> str:
    """The data that contradict the others."""
    if verdict.relaxing.without_k1:
        return "K* by itself is possible: it is K1 of the static test that contradicts it"
    values = verdict.relaxing.impossible.tolist()
    if len(values) == count:
        named = f"all {count} frequencies"
    elif values:
        named = f"{first_of([f'{value:.5g}' for value in values], _MOST_NAMED)} Hz"
    else:
        named = "no frequency by itself, but all of them together"
    return f"not possible with the others as they are: {named}"
