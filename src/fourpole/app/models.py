"""The commands on models: fit, causality, map and query."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fourpole import quantities as q
from fourpole import units
from fourpole.app.console import OK, option, out, print_json, progress, say, warn
from fourpole.app.model_words import show_fit, show_map, show_rows
from fourpole.core.rig import Rig
from fourpole.errors import CampaignError, ModelError, UnitError
from fourpole.fitting.measured import Measured, MeasuredSet, read_measured, table_of
from fourpole.fitting.modelfile import ModelFile, read_model_file
from fourpole.fitting.modelling import fit_tyres, lacking_error, map_tyres, model_file, rig_file
from fourpole.fitting.query import Query, ask
from fourpole.models.causality import Possible, check_possible
from fourpole.models.families import automatic, model_named, sizes_of
from fourpole.study.results import Results, read_results

__all__ = ["DataOptions", "fitted", "run_causality", "run_fit", "run_map", "run_query", "state_of"]

#: Relative uncertainty of K* for a verdict where a table states none.
_ASSUMED = 0.01
_MOST_NAMED = 12
#: Kind of quantity of each unit of a parameter.
_KINDS = {"N/m": "stiffness", "N s/m": "damping", "s": "time", "m": "length", "Pa": "pressure"}


@dataclass(frozen=True)
class DataOptions:
    """What is taken of the results, as text with units; `relative` is an uncertainty of K* that was assumed."""

    tyre: str | None = None
    band: str | None = None
    over: tuple[str, ...] = ()
    std: str | None = None
    k1: str | None = None
    std_k1: str | None = None
    relative: float | None = None

    def read(self, path: Path) -> MeasuredSet:
        """K* of the conditions."""
        std = self.relative if self.std is None else option(self.std, "ratio", "--std")
        if std is not None and not 0 < std < 1:
            raise UnitError("--std: the uncertainty of K* must lie between 0 and 100 %")
        found = read_measured(path, over=self.over, std=std, k1=self._static())
        return found.only(self.tyre, self._limits())

    def settings(self) -> dict[str, Any]:
        """As they stand in a model file."""
        named = {"tyre": self.tyre, "band": self.band, "std": self.std, "k1": self.k1, "std_k1": self.std_k1}
        given = {name: value for name, value in named.items() if value is not None}
        return {**given, **({"over": list(self.over)} if self.over else {})}

    def _static(self) -> tuple[float, float] | None:
        if self.k1 is None:
            if self.std_k1 is not None:
                raise UnitError("--std-k1 is of --k1: state both")
            return None
        k1 = option(self.k1, "stiffness", "--k1")
        if k1 <= 0:
            raise UnitError("--k1: must be positive")
        std = option("2 %" if self.std_k1 is None else self.std_k1, "ratio", "--std-k1")
        return k1, std * k1

    def _limits(self) -> tuple[float, float] | None:
        if self.band is None:
            return None
        try:
            low_text, high_text = self.band.split("..") if ".." in self.band else self.band.split(":")
            unit = high_text.strip().lstrip("0123456789.,eE+- ")
            low = units.quantity(low_text if any(map(str.isalpha, low_text)) else f"{low_text} {unit}", "frequency")
            high = units.quantity(high_text, "frequency")
        except (ValueError, UnitError):
            low, high = 1.0, 0.0
        if not 0 < low < high:
            raise UnitError(f"--band: {units.shown(self.band)} is not two rising frequencies, as in '0.1:100 Hz'")
        return low, high


def run_fit(
    path: Path,
    model: str,
    data: DataOptions,
    fixed: Sequence[str],
    share: Sequence[str],
    file: Path | None,
    figure: Path | None,
    *,
    as_json: bool,
) -> int:
    """Fit or choose a model for each tyre; write the model file and its figures."""
    measured = data.read(path)
    _notes(measured)
    with progress("fitting") as advance:
        fits = fit_tyres(measured, model, given=_fixed(fixed, model), share=share, progress=advance)
    more = {"fix": list(fixed), "share": list(share)}
    settings = {"model": model, **data.settings(), **{name: what for name, what in more.items() if what}}
    made = model_file(measured, fits, settings=settings, rig=_rig_of(path))
    target = file if file is not None else (path / "model.json" if path.is_dir() else None)
    drawn = _figures(path, measured, made, figure)
    if target is not None:
        made.write(target)
    if as_json:
        print_json(made.model_dump(mode="json"))
    else:
        for entry in made.models:
            show_fit(entry)
        for place in [*([target] if target is not None else []), *drawn]:
            out(f"written: {place}")
    return OK


def fitted(results: Results, folder: Path) -> Results:
    """Results just written to a folder, with a model chosen for each tyre, in model.json too; a note where none is."""
    target = folder / "model.json"
    try:
        measured = read_measured(folder)
        with progress("choosing models") as advance:
            made = model_file(
                measured,
                fit_tyres(measured, progress=advance),
                settings={"model": "auto"},
                rig=rig_file(results.record, results.rig),
            )
    except ModelError as error:
        say(f"note: no model was fitted: {error}")
        target.unlink(missing_ok=True)
        return results
    made.write(target)
    return replace(results, models=made)


def run_causality(path: Path, data: DataOptions, *, as_json: bool) -> int:
    """Say of each condition whether any passive linear tyre can have its K*."""
    measured = data.read(path)
    if not measured.known:
        warn(f"the table states no uncertainty of K*: taken as {100 * _ASSUMED:g} %; state --std")
        measured = replace(data, relative=_ASSUMED).read(path)
    else:
        _notes(measured)
    found = [(one, check_possible(one.data)) for one in measured.conditions]
    if as_json:
        rows = [{"tyre": one.tyre, "state": one.state, **_verdict(one, verdict)} for one, verdict in found]
        print_json({"source": measured.source, "conditions": rows})
        return OK
    for one, verdict in found:
        where = " at ".join(part for part in (one.tyre, one.label) if part) or measured.source
        text = f"{where}: {'possible' if verdict.possible else 'NOT possible'} for a passive linear tyre (chi-square "
        out(f"{text}{verdict.chi2:.4g} for {verdict.dof} degrees of freedom, chance {verdict.chance:.2g})")
        if not verdict.possible:
            out(f"  {_blamed(verdict, one.own.count)}")
            out(f"  it could, were K* uncertain by {100 * lacking_error(one, verdict):.2g} % at each frequency")
    bad = sum(not verdict.possible for _, verdict in found)
    out(f"{len(found) - bad} of {len(found)} conditions are possible")
    if bad:
        say(
            "either the tests are at fault (a gain, a resonance, an unsettled tyre), or their uncertainty is, or the "
            "tyre is not linear, so that each test sees another stiffness; fourpole rig says what the rig explains"
        )
    return OK


def run_map(path: Path, model: str, data: DataOptions, file: Path | None, *, as_json: bool) -> int:
    """Make the operating map of each tyre and write it."""
    measured = data.read(path)
    _notes(measured)
    with progress("mapping") as advance:
        maps = map_tyres(measured, model, data.over, progress=advance)
    made = model_file(measured, maps=maps, settings={"model": model, **data.settings()}, rig=_rig_of(path))
    target = file if file is not None else (path / "map.json" if path.is_dir() else Path("map.json"))
    made.write(target)
    drawn = _figures(path, measured, made, None)
    if as_json:
        print_json(made.model_dump(mode="json"))
        return OK
    for one in maps:
        show_map(one)
    for place in [target, *drawn]:
        out(f"written: {place}")
    return OK


def run_query(
    path: Path,
    state: Mapping[str, float],
    frequency: str,
    tyre: str | None,
    rig: Rig | None,
    *,
    beyond: bool,
    file: Path | None,
    as_json: bool,
) -> int:
    """Ask a model file."""
    try:
        grid = units.frequency_grid(frequency)
    except UnitError as error:
        raise UnitError(f"--frequency: {error}") from None
    rows = ask(read_model_file(path), Query(grid, state, tyre, rig, beyond))
    for remark in dict.fromkeys(row["remarks"] for row in rows if row["remarks"]):
        warn(remark)
    if file is not None:
        import polars as pl

        from fourpole.io.write import write_table

        write_table(file if file.suffix else file.with_suffix(".csv"), pl.DataFrame(rows), label=str(file))
        say(f"written: {file}")
    if as_json:
        print_json({"rows": rows})
    elif file is None:
        show_rows(rows)
    return OK


def state_of(
    pressure: str | None, preload: str | None, temperature: str | None, more: Sequence[str]
) -> dict[str, float]:
    """The operating point of the options, by column."""
    state: dict[str, float] = {}
    for text, kind, column in (
        (pressure, "pressure", q.PRESSURE.head),
        (preload, "force", q.PRELOAD.head),
        (temperature, "temperature", q.TEMPERATURE.head),
    ):
        if text is not None:
            state[column] = option(text, kind, f"--{column.split(' ', maxsplit=1)[0]}")
    for text in more:
        column, mark, value = text.rpartition("=")
        try:
            state[column.strip()] = float(value) if mark else math.nan
        except ValueError:
            state[column.strip()] = math.nan
        if not math.isfinite(state[column.strip()]):
            raise UnitError(f"--at: {units.shown(text)} is not a column and a number, as in 'camber [deg] = 2'")
    return state


def _fixed(texts: Sequence[str], model: str) -> dict[str, float]:
    """Parameters that are given, by symbol; a bare number is in the parameter's SI unit."""
    wanted = automatic() if model == "auto" else (model,)
    names = [f"{name}:{sizes[-1]}" if (sizes := sizes_of(name)) else name for name in wanted]
    known = {one.symbol: one.unit for name in names for one in model_named(name).parameters}
    found = {}
    for text in texts:
        symbol, mark, value = (part.strip() for part in text.partition("="))
        if not mark or symbol not in known:
            there = ", ".join(list(known)[:_MOST_NAMED])
            raise UnitError(
                f"--fix: {units.shown(text)} is not a parameter and its value, as in 'K1=180 kN/m'; there are {there}"
            )
        try:
            found[symbol] = float(value)
        except ValueError:
            found[symbol] = option(value, _KINDS.get(known[symbol], "ratio"), f"--fix {symbol}")
    return found


def _notes(measured: MeasuredSet) -> None:
    for note in measured.notes:
        say(f"note: {note}")


def _rig_of(path: Path) -> Any:
    """The rig of the tests, for TR; none where results are a table by itself."""
    folder = path if path.is_dir() else path.parent
    try:
        results = read_results(folder)
    except CampaignError:
        return None
    return rig_file(results.record, results.rig)


def _figures(path: Path, measured: MeasuredSet, made: ModelFile, figure: Path | None) -> list[Path]:
    """Figures of a model file, in the results' folder, or the one that is asked for."""
    import polars as pl

    from fourpole.plot import draw, save_figures, write_figure

    field: dict[str, Any] = {"maps" if made.kind == "map" else "models": made}
    keys = ("map",) if made.kind == "map" else ("model", "model-choice")
    if path.is_dir():
        results = replace(read_results(path), **field)
        folder = path / "figures"
        drawn = list(save_figures(results, folder, keys=keys).values())
    else:
        results = Results(pl.DataFrame(), table_of(measured), pl.DataFrame(), **field)
        drawn = []
    if figure is not None:
        one = draw(results, keys[0])
        if one is None:
            raise ModelError("there is nothing to draw")
        drawn.append(write_figure(one, keys[0], figure))
    return drawn


def _verdict(one: Measured, verdict: Possible) -> dict[str, Any]:
    return {
        "possible": verdict.possible,
        "chi2": verdict.chi2,
        "dof": verdict.dof,
        "chance": verdict.chance,
        "possible with an error of [1]": lacking_error(one, verdict),
        "impossible [Hz]": verdict.impossible.tolist(),
        "possible without K1": verdict.without_k1,
    }


def _blamed(verdict: Possible, count: int) -> str:
    """What cannot be with the rest."""
    if verdict.without_k1:
        return "K* by itself is possible: it is K1 of the static test that no such tyre has with it"
    values = verdict.impossible.tolist()
    said = "what no such tyre can give, with the others as they are: "
    if len(values) == count:
        return f"{said}all {count} frequencies"
    if not values:
        return f"{said}no frequency by itself, but all of them together"
    named = ", ".join(f"{value:.5g}" for value in values[:_MOST_NAMED])
    return f"{said}{named}{f' and {len(values) - _MOST_NAMED} more' if len(values) > _MOST_NAMED else ''} Hz"
