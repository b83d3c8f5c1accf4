"""What limits a campaign: of each rig's K2 and C the largest source of uncertainty, and its cheapest remedy."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
import polars as pl

from fourpole.campaign.results import Results
from fourpole.report.digits import known
from fourpole.report.stated import RIG_VALUES, mapping
from fourpole.report.words.phrases import counted, percent

__all__ = ["Limit", "limit_rows", "limits", "source_in_words"]

_BUDGET = ("test", "quantity", "source", "share [1]")
#: Quantity of budget.csv: its value and uncertainty in dynamic.csv.
_COLUMNS = {
    "K2": ("K2 [N/m]", "u(K2) [N/m]"),
    "C": ("C [N s/m]", "u(C) [N s/m]"),
    "Re K*": ("Re K* [N/m]", "u(Re K*) [N/m]"),
    "Im K*": ("Im K* [N/m]", "u(Im K*) [N/m]"),
}
_SYMBOLS = {"Re K*": "K′", "Im K*": "K″"}
#: A second source is named from this share on.
_WORTH_NAMING = 0.1
_MOST_OF_IT = 0.5
_SOURCES = {
    "sensor noise": "the noise of the sensors",
    "frequency": "the uncertainty of the frequency",
    "K1 fit": "the fit of K1",
    "K1 branch gap": "the gap between the branches of K1",
    "K1 cycles": "the change of K1 from cycle to cycle",
    "K1 stated": "K1 as stated",
    "rig misfit": "the misfit of the rig",
}
_K1_REMEDIES = {
    "K1 fit": "repeat the static test with finer steps of load round the preload",
    "K1 branch gap": "use K' and K'', which need no K1; or state the K1 that you mean, with its uncertainty, in "
    "tests.csv (the gap is the rubber's own hysteresis, which no test closes)",
    "K1 cycles": "repeat the static test with more cycles, until two follow each other closely",
    "K1 stated": "state K1 with a smaller uncertainty, or add a static test",
}


@dataclass(frozen=True)
class Limit:
    """What limits one quantity on one rig.

    Attributes
    ----------
    rig, quantity, source : str
        As in the tables.
    share : float [1]
        Median share of the variance over the tests.
    relative : float or None [1]
        Median relative uncertainty of the quantity.
    tests : int
    remedy, text : str
        What to do; the whole in sentences.
    """

    rig: str
    quantity: str
    source: str
    share: float
    relative: float | None
    tests: int
    remedy: str
    text: str


@dataclass(frozen=True)
class _About:
    """What a remedy depends on."""

    joint: bool
    massed: bool
    with_v2: bool
    fits: bool
    scatter: bool
    candidate: str


def limits(results: Results) -> list[Limit]:
    """For each rig what limits K2 and C, or K* where these are unknown; nothing without a budget.

    Parameters
    ----------
    results : Results

    Returns
    -------
    list of Limit
        By rig, then quantity. Rejected tests do not count.
    """
    budget = results.budget
    if budget.is_empty() or any(name not in budget.columns for name in _BUDGET):
        return []
    tests = results.dynamic.filter(pl.col("verdict") != "rejected").unique("test", maintain_order=True)
    rows = (
        budget.select(_BUDGET)
        .with_columns(pl.col("share [1]").cast(pl.Float64, strict=False).fill_nan(None))
        .drop_nulls()
        .join(tests.select("test", pl.col("rig").fill_null("")), on="test", how="inner")
    )
    found = []
    for name in dict.fromkeys(tests["rig"].fill_null("").to_list()):
        here, about = rows.filter(pl.col("rig") == name), _about(results, tests, name)
        for quantity in _quantities(here):
            part = here.filter(pl.col("quantity") == quantity)
            found.append(_limit(name, quantity, part, tests, about))
    return found


def _quantities(rows: pl.DataFrame) -> list[str]:
    present = set(rows["quantity"].to_list())
    return [name for name in ("K2", "C") if name in present] or [name for name in _COLUMNS if name in present]


def _median_shares(rows: pl.DataFrame) -> list[tuple[str, float]]:
    """Sources by their median share over the tests, the largest first; a test without a source has none of it."""
    tests = rows["test"].n_unique()
    shares = []
    for (source,), part in rows.group_by("source", maintain_order=True):
        values = part.group_by("test").agg(pl.col("share [1]").sum())["share [1]"].to_numpy()
        padded = np.concatenate([values, np.zeros(tests - values.size)])
        shares.append((str(source), float(np.median(padded)), float(padded.mean())))
    shares.sort(key=lambda item: item[1:], reverse=True)
    return [(source, middle) for source, middle, _ in shares]


def _about(results: Results, tests: pl.DataFrame, rig: str) -> _About:
    here = tests.filter(pl.col("rig").fill_null("") == rig)
    joint = mapping(results.record, "joint", rig)
    named = joint.get("candidates")
    first = named[0] if isinstance(named, list) and named else {}
    return _About(
        joint="joint" in here["route"].to_list(),
        massed=any((known(mass) or 0.0) > 0 for mass in here["added mass [kg]"].to_list()),
        with_v2=any(known(v2) for v2 in here["V2 [m/s]"].to_list()),
        fits=joint.get("fits") is not False,
        scatter=bool(known(joint.get("scatter"))),
        candidate=str(mapping(first).get("text") or ""),
    )


def _limit(rig: str, quantity: str, rows: pl.DataFrame, tests: pl.DataFrame, about: _About) -> Limit:
    shares, names = _median_shares(rows), rows["test"].unique()
    source, share = shares[0]
    of_source = rows.filter(pl.col("source") == source).group_by("test").agg(pl.col("share [1]").sum())
    here = tests.filter(pl.col("test").is_in(names.to_list())).join(of_source, on="test", how="left")
    relative, left = _relative(here, quantity), _relative(here, quantity, without=True)
    remedy = _remedy(source, about)
    symbol = _SYMBOLS.get(quantity, quantity)
    opening = (
        f"{symbol} is known to {percent(relative)} (median of {counted(len(names), 'test')}). " if relative else ""
    )
    much = "makes most of that" if share >= _MOST_OF_IT else "is the largest part of it"
    if not relative:
        much = f"makes most of the uncertainty of {symbol}" if share >= _MOST_OF_IT else f"limits {symbol} most"
    text = f"{opening}{_capital(source_in_words(source))} {much}, with {percent(share)} of the variance"
    if relative and left:
        text += f"; without it about {percent(left)} would be left"
    if len(shares) > 1 and shares[1][1] >= _WORTH_NAMING:
        text += f". Next is {source_in_words(shares[1][0])} with {percent(shares[1][1])}"
    return Limit(rig, quantity, source, share, relative, len(names), remedy, f"{text}. Cheapest remedy: {remedy}.")


def _relative(tests: pl.DataFrame, quantity: str, *, without: bool = False) -> float | None:
    """Median relative uncertainty over tests; without the share of the source that stands beside them, if so asked."""
    value, std = _COLUMNS[quantity]
    found = []
    for row in tests.rows(named=True):
        x, u, share = known(row.get(value)), known(row.get(std)), known(row.get("share [1]")) or 0.0
        if x and u is not None:
            found.append(u / abs(x) * sqrt(max(1.0 - share, 0.0) if without else 1.0))
    return float(np.median(found)) if found else None


def source_in_words(source: str) -> str:
    """A source of budget.csv inside a sentence.

    Examples
    --------
    >>> source_in_words("gain F1"), source_in_words("moving_mass"), source_in_words("sensor noise")
    ("F1's gain", 'the moving mass m', 'the noise of the sensors')
    """
    kind, _, of = source.partition(" ")
    if source in RIG_VALUES:
        return f"the {RIG_VALUES[source][0]}"
    if kind in ("gain", "phase", "delay") and of:
        return f"{of}'s {kind}"
    if kind == "response":
        what, _, symbol = of.partition(" ")
        return f"the {what} of {symbol}'s calibrated response"
    if kind == "added":
        return f"the weight of the {source}"
    if source.startswith("K1 gains"):
        return "the calibration of load and deflection in K1"
    return _SOURCES.get(source, source)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _remedy(source: str, about: _About) -> str:
    """The cheapest thing to do about a source."""
    kind, _, of = source.partition(" ")
    if source in RIG_VALUES:
        return _rig_remedy(source, about)
    if kind in ("gain", "phase") and of:
        return _channel_remedy(kind, of, about)
    if source.startswith("K1 gains"):
        return "calibrate the load and deflection channels of the static rig"
    if kind == "added":
        return "weigh the added mass on a better balance"
    return {
        "sensor noise": _noise_remedy(about),
        "frequency": "record longer at a steady speed",
        "rig misfit": _misfit_remedy(about),
        **_K1_REMEDIES,
    }.get(source, f"state {source} with a smaller uncertainty")


def _channel_remedy(kind: str, symbol: str, about: _About) -> str:
    if about.massed and about.joint:
        return "repeat the tests with the weighed mass, or record them longer: the mass calibrates the channels"
    if about.massed:
        return "use the joint route: with the weighed mass it needs no calibrated sensor"
    return (
        "repeat one condition with a weighed mass added and use the joint route, which makes calibrated sensors "
        f"unnecessary, or calibrate the {kind} of {symbol}"
    )


def _noise_remedy(about: _About) -> str:
    if not about.fits:
        return _misfit_remedy(about)
    if about.scatter:
        return "steady temperature, conditioning and amplitude, then repeat: the scatter of repeats counts as noise"
    return "record longer or over more cycles: four times as many halve it"


def _rig_remedy(source: str, about: _About) -> str:
    stated = "weigh it" if RIG_VALUES[source][1] == "kg" else "measure it by itself"
    text = f"{stated} and state it with a smaller uncertainty"
    if about.joint:
        return text if about.massed else f"{text}, or repeat one condition with a weighed mass added"
    if about.with_v2:
        return f"use the joint route, which finds it from V2, or {text}"
    return f"{text}, or measure V2 too and use the joint route"


def _misfit_remedy(about: _About) -> str:
    """Name the part that would explain the misfit."""
    if about.candidate:
        return f"settle the misfit first; what would explain it best is {about.candidate}"
    return "settle the misfit first: look for a part of the rig that is not stated"


def limit_rows(found: list[Limit]) -> list[dict[str, Any]]:
    """For programs: a row per rig and quantity."""
    return [
        {
            "rig": limit.rig,
            "quantity": limit.quantity,
            "source": limit.source,
            "share [1]": limit.share,
            "relative uncertainty [1]": limit.relative,
            "tests": limit.tests,
            "remedy": limit.remedy,
        }
        for limit in found
    ]
