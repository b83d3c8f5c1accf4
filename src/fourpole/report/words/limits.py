"""Sources of error in words, with their remedies; which of them limits a campaign most."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import known
from fourpole.core.sources import Kind, Role, Source
from fourpole.fitting.rows import KEY, keyed
from fourpole.plot.data import kept
from fourpole.quantities import RIG_VALUES, ShownUnits
from fourpole.report.digits import SENTENCES, counted, percent
from fourpole.study.record import stated_blocked
from fourpole.study.rig_estimate import NoteCode, RigEstimate
from fourpole.study.study import Study
from fourpole.words import cause_words

#: Parts of a rig that are not stated: name inside a sentence, name in a table, SI unit, unit shown and its SI value.
_UNSTATED: dict[str, tuple[str, str, str, str, float]] = SENTENCES["unstated"]
#: Name of each kind of source inside a sentence, and its remedy before rig and tests are considered.
_WORDS: dict[Kind, tuple[str, str]] = {Kind[name]: texts for name, texts in SENTENCES["sources"].items()}


@dataclass(frozen=True)
class About:
    """Facts of one rig on which the choice of a remedy depends.

    Attributes
    ----------
    joint, massed, with_v2, blocked, with_f1 : bool
        Whether the joint route was used, an added mass was used, V2 was measured, the far side is blocked, F1 was
        measured.
    fits, scatter : bool
        Whether rig and channels as stated fit their tests; whether K* of repeated tests scatters beyond the noise.
    candidate : str
        The unstated part that would explain a misfit best, in words; empty where there is none.
    """

    joint: bool
    massed: bool
    with_v2: bool
    fits: bool
    scatter: bool
    candidate: str
    blocked: bool = False
    with_f1: bool = True


_BY_MASS = (
    "repeat one condition with a weighed mass added and use the joint route, which makes calibrated sensors "
    "unnecessary, or "
)
#: Errors of channels that no mass calibrates.
_NOBODY_STATES = (Kind.CROSSTALK, Kind.FIXTURE, Kind.GAIN_DRIFT, Kind.GAIN_STEP)
#: Errors of channels that change with frequency; a key takes them off sooner than more tests with a mass.
_OVER_FREQUENCY = (Kind.DELAY, Kind.LOW_CUT, Kind.SLOPE)
#: Kinds of source that a mass makes needless to calibrate.
_CALIBRATED = (Kind.GAIN, Kind.PHASE, Kind.DELAY, Kind.RESPONSE_GAIN, Kind.RESPONSE_PHASE)
#: Name in a table and unit shown of each kind that needs no more, and SI values of these units other than 1.
_SHOWN: dict[Kind, tuple[str, str]] = {Kind[name]: texts for name, texts in SENTENCES["shown"].items()}
_SI = {"%": 0.01, "°": pi / 180, "ms": 1e-3}


def source_in_words(source: Source) -> str:
    """The name of a source inside a sentence.

    Examples
    --------
    >>> source_in_words(Source(Kind.GAIN, "F1")), source_in_words(Source(Kind.RIG_VALUE, "moving_mass"))
    ("F1's gain", 'the moving mass m')
    """
    return _filled(_WORDS[source.kind][0], source)


def _filled(template: str, source: Source) -> str:
    value = RIG_VALUES[source.of] if source.kind is Kind.RIG_VALUE else None
    measure = "weigh it" if value and value.unit == "kg" else "measure it by itself"
    if source.of == "preload_damping":
        measure = "measure it by the decay of the rig without a specimen (preload_damping)"
    name = _UNSTATED[source.of][0] if source.kind is Kind.UNSTATED else value.name if value else source.text
    return template.format(
        channel=f"{source.of} against {source.under}" if source.under else source.of,
        name=(source.of or "the specimen") if source.role is Role.SPECIMEN else name,
        measure=measure,
    )


def remedy_of(source: Source) -> str:
    """The remedy of a source before rig and tests are considered."""
    return _filled(_WORDS[source.kind][1], source)


def remedy(source: Source, about: About) -> str:
    """The cheapest remedy of a source."""
    text = remedy_of(source)
    if source.kind is Kind.RIG_MISFIT or (source.kind is Kind.NOISE and not about.fits):
        best = f"resolve the misfit first; the best candidate is {about.candidate}"
        return best if about.candidate else _WORDS[Kind.RIG_MISFIT][1]
    if source.kind is Kind.NOISE and about.scatter:
        return "steady temperature, conditioning and amplitude, then repeat: the scatter of repeats counts as noise"
    if not about.with_f1:
        return f"{text}, or test at higher frequencies or with a heavier mass" if source.role is Role.RIG else text
    if source.role is Role.RIG:
        return _rig_remedy(text, about)
    if source.role is Role.CHANNEL and about.massed and source.kind not in _NOBODY_STATES:
        if not about.joint:
            return "use the joint route: with the weighed mass it needs no calibrated sensor"
        by_mass = "repeat the tests with the weighed mass, or record them longer: the mass calibrates the channels"
        return text if source.kind in _OVER_FREQUENCY else by_mass
    if about.blocked or source.kind not in _CALIBRATED:
        alone = source.role is Role.SPECIMEN and not (about.joint or about.blocked)
        return "use the joint route, which takes it out of K*" if alone else text
    return f"{'' if about.with_v2 else 'measure V2 too, '}{_BY_MASS}{text}"


def _rig_remedy(text: str, about: About) -> str:
    if about.joint:
        return text if about.massed else f"{text}, or repeat one condition with a weighed mass added"
    if about.with_v2:
        return f"use the joint route, which finds it from V2, or {text}"
    return f"{text}, or measure V2 too and use the joint route"


def in_words(source: Source, unit: str = "", units: ShownUnits | None = None) -> tuple[str, str, float, float]:
    """Name, unit shown, SI value of that unit, and the SI value shown as zero, in the units that are wanted.

    Examples
    --------
    >>> in_words(Source(Kind.RIG_VALUE, "preload_stiffness"), "N/m")
    ('preload spring K3', 'kN/m', 1000.0, 0.0)
    >>> in_words(Source(Kind.GAIN, "V1"), "1"), in_words(Source(Kind.GAIN, "F1", "V1"), "1")[0]
    (('gain of V1', '%', 0.01, 1.0), 'gain of F1 over V1')
    """
    of, under = source.of, source.under
    if source.kind is Kind.UNSTATED:
        _, name, unit, shown, scale = _UNSTATED[of]
        return name, *(units or ShownUnits()).wanted.get(unit, (shown, scale)), 0.0
    if source.kind is Kind.RIG_VALUE:
        value = (units or ShownUnits()).of(RIG_VALUES[of])
        return value.name, value.suffix, value.scale, 0.0
    if source.kind in _SHOWN:
        name, shown = _SHOWN[source.kind]
        gain = source.kind is Kind.GAIN
        what = f"{of} {'over' if gain else 'less'} {under}" if under else of or "the specimen"
        return name.format(what), shown, _SI.get(shown, 1.0), float(gain)
    return source.text.replace("_", " "), "" if unit == "1" else unit, 1.0, 0.0


_BUDGET = ("test", "quantity", "source", q.SHARE.head)
#: Quantities of budget.csv for which a limit is given.
_QUANTITIES = {one.column: one for one in (q.STORAGE, q.LOSS, q.K2, q.C)}
#: A second source is named if its share of the variance is at least this.
_WORTH_NAMING = 0.1
#: A source makes most of an uncertainty if its share of the variance is at least this.
_MOST_OF_IT = 0.5


@dataclass(frozen=True)
class Limit:
    """The largest source of uncertainty of one quantity on one rig.

    Attributes
    ----------
    rig, quantity : str
        Names as in the tables.
    source : Source
        The largest source of its uncertainty.
    share : float [1]
        Median share of the variance over the tests.
    relative : float or None [1]
        Median relative uncertainty of the quantity.
    tests : int
    remedy, text : str
        The remedy alone; the limit and the remedy in sentences.
    """

    rig: str
    quantity: str
    source: Source
    share: float
    relative: float | None
    tests: int
    remedy: str
    text: str

    @property
    def symbol(self) -> str:
        """The symbol of the quantity."""
        return _QUANTITIES[self.quantity].symbol


def limits(results: Study) -> list[Limit]:
    """The limits of K', K'', K2 and C for each rig; empty without a budget.

    Parameters
    ----------
    results : Study

    Returns
    -------
    list of Limit
        One limit per rig and quantity, sorted by rig. Rejected tests do not count.
    """
    return kept(results, "limits", lambda: _all_limits(results))


def _all_limits(results: Study) -> list[Limit]:
    budget = results.budget
    if budget.is_empty() or any(name not in budget.columns for name in _BUDGET):
        return []
    tests = results.dynamic.filter(pl.col("verdict") != Verdict.REJECTED)
    tests = keyed(tests).unique(KEY, maintain_order=True)
    rows = (
        keyed(budget)
        .select(*KEY, *_BUDGET[1:])
        .with_columns(pl.col(q.SHARE.head).cast(pl.Float64, strict=False).fill_nan(None))
        .drop_nulls()
        .join(tests.select(*KEY, pl.col("rig").fill_null("")), on=KEY, how="inner")
    )
    found = []
    for name in dict.fromkeys(tests["rig"].fill_null("").to_list()):
        here, about = rows.filter(pl.col("rig") == name), _about(results, tests, name)
        for quantity in _QUANTITIES:
            part = here.filter(pl.col("quantity") == quantity)
            if part.is_empty():
                continue
            found.append(_limit(name, quantity, part, tests, about))
    return found


def scales(results: Study) -> list[SimpleNamespace]:
    """What the scale of K* rests on, for each rig: in a few words, with U, and the sentence with all of it."""
    found = [_scale(results, rig) for rig in results.rigs if rig.rests and not rig.wrong_channels]
    if not found and not results.rigs and (results.dynamic["verdict"] != Verdict.REJECTED).any():
        routes = set(results.dynamic.get_column("route", default=pl.Series(dtype=pl.Utf8)))
        rests = "by_mass" if routes == {"transmissibility"} else "unchecked"
        found = [SimpleNamespace(text=SENTENCES["scale"][rests], rest="")]
    return found


def _scale(results: Study, rig: RigEstimate) -> SimpleNamespace:
    """The largest source of u(K') of a rig, what it is known to, and what would free K* from it."""
    said, of_rig = SENTENCES["scale"], results.dynamic.filter(pl.col("verdict") != Verdict.REJECTED)
    of_rig = keyed(of_rig.filter(pl.col("rig").fill_null("") == rig.rig))
    budget = results.budget
    text = rig.rests.split(";")[0].split(", ")[0]
    if all(name in budget.columns for name in _BUDGET) and of_rig.height:
        rows = keyed(budget).filter(pl.col("quantity") == q.STORAGE.column).join(of_rig.select(KEY), on=KEY, how="semi")
        shares = _median_shares(rows.drop_nulls(q.SHARE.head))
        if shares:
            source = Source.read(shares[0][0], rig.rig)
            value = next((one for one in rig.values if one.source.text == source.text), None)
            known_to = value and (value.found_std or value.stated_std)
            size = abs(value.found or value.stated or 0.0) if value else 0.0
            text = source_in_words(source)
            text += f", {percent(COVERAGE_FACTOR * known_to / size)}" if known_to and size else ""
            text += said["freed"] if source.kind in _CALIBRATED and not rig.massed else ""
    named = f"{rig.rig}: " if len(results.rigs) > 1 else ""
    return SimpleNamespace(text=f"{named}{text}", rest=f"{_capital(rig.rests.rstrip('.'))}.")


def _median_shares(rows: pl.DataFrame) -> list[tuple[str, float]]:
    """Sources by their median share over the tests, the largest first; a test without a source counts as zero."""
    tests, values = rows.select(KEY).n_unique(), dict[str, list[float]]()
    of_tests = rows.group_by("source", *KEY, maintain_order=True).agg(pl.col(q.SHARE.head).sum())
    for source, share in of_tests.select("source", q.SHARE.head).iter_rows():
        values.setdefault(str(source), []).append(share)
    padded = {source: np.array([*some, *[0.0] * (tests - len(some))]) for source, some in values.items()}
    shares = [(source, float(np.median(each)), float(each.mean())) for source, each in padded.items()]
    shares.sort(key=lambda item: item[1:], reverse=True)
    return [(source, middle) for source, middle, _ in shares]


def _about(results: Study, tests: pl.DataFrame, rig: str) -> About:
    here = tests.filter(pl.col("rig").fill_null("") == rig)
    found = results.rig_named(rig)
    return About(
        joint="joint" in here["route"].to_list(),
        massed=any((known(mass) or 0.0) > 0 for mass in here[q.ADDED_MASS.head].to_list()),
        with_v2=any(known(v2) for v2 in here[q.V2.head].to_list()),
        fits=found.fits,
        scatter=NoteCode.SCATTER in found.notes,
        candidate=cause_words(found.candidates[0]) if found.candidates else "",
        blocked=stated_blocked(results.record, rig),
        with_f1=any(known(f1) for f1 in here[q.F1.head].to_list()),
    )


def _limit(rig: str, quantity: str, rows: pl.DataFrame, tests: pl.DataFrame, about: About) -> Limit:
    shares, names = _median_shares(rows), rows["test"].unique()
    (source, share), *others = ((Source.read(text, rig), share) for text, share in shares)
    of_source = rows.filter(pl.col("source") == source.text).group_by(KEY).agg(pl.col(q.SHARE.head).sum())
    here = tests.join(rows.select(KEY).unique(), on=KEY, how="semi").join(of_source, on=KEY, how="left")
    relative, left = _relative(here, quantity), _relative(here, quantity, without=True)
    symbol = _QUANTITIES[quantity].symbol
    opening = (
        f"U of {symbol} is {percent(COVERAGE_FACTOR * relative)} (median of {counted(len(names), 'test')}). "
        if relative
        else ""
    )
    much = "makes most of that" if share >= _MOST_OF_IT else "is the largest part of it"
    if not relative:
        much = f"makes most of the uncertainty of {symbol}" if share >= _MOST_OF_IT else f"limits {symbol} most"
    text = f"{opening}{_capital(source_in_words(source))} {much}, with {percent(share)} of the variance"
    if relative and left:
        text += f"; without it about {percent(COVERAGE_FACTOR * left)} would be left"
    if others and others[0][1] >= _WORTH_NAMING:
        text += f". Next is {source_in_words(others[0][0])} with {percent(others[0][1])}"
    what = remedy(source, about)
    return Limit(rig, quantity, source, share, relative, len(names), what, f"{text}. Cheapest remedy: {what}.")


def _relative(tests: pl.DataFrame, quantity: str, *, without: bool = False) -> float | None:
    """Median relative uncertainty over tests [1]; `without` leaves out the share in each row."""
    value, std = _QUANTITIES[quantity].heads
    found = []
    for row in tests.rows(named=True):
        x, u, share = known(row.get(value)), known(row.get(std)), known(row.get(q.SHARE.head)) or 0.0
        if x and u is not None:
            found.append(u / abs(x) * sqrt(max(1.0 - share, 0.0) if without else 1.0))
    return float(np.median(found)) if found else None


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def limit_rows(found: list[Limit]) -> list[dict[str, Any]]:
    """The limits as rows for programs, one per rig and quantity."""
    return [
        {
            "rig": limit.rig,
            "quantity": limit.quantity,
            "source": limit.source.text,
            q.SHARE.head: limit.share,
            "relative uncertainty [1]": limit.relative,
            "tests": limit.tests,
            "remedy": limit.remedy,
        }
        for limit in found
    ]
