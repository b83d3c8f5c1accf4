"""Scores as tables of Markdown: the benchmark of all methods, and of Fourpole the coverage and the faults."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import polars as pl

from elastomer_truth.faults import FAULTS, sized
from elastomer_truth.score import Score, summary

#: Numbers of a score: the head, the column of the table, and how it is shown.
_SHOWN: tuple[tuple[str, str, str], ...] = (
    ("answered", "answered", ".1%"),
    ("median error", "median error", ".2%"),
    ("coverage", "coverage", ".1%"),
    ("from", "coverage, low", ".1%"),
    ("to", "coverage, high", ".1%"),
    ("rms z", "rms z", ".3g"),
    ("interval score", "interval score", ".3g"),
    ("wrong with confidence", "confident wrong values", ".2%"),
    ("campaigns with one", "campaigns with one", "d"),
    ("flagged", "flagged", ".1%"),
)
_HEADS = [head for head, _, _ in _SHOWN]
#: Those of them that say whether uncertainties hold errors.
_HELD = ["answered", "coverage", "from", "to", "rms z", "wrong with confidence", "campaigns with one", "flagged"]
#: The method whose coverage and faults have pages of their own.
OWN = "fourpole joint"
#: Goals: least coverage, range of rms z, largest shares of wrong values and of campaigns, least share of causes named.
_GOALS = {"honest": (0.91, (0.85, 1.15), 1e-3, 0.01, None), "ordinary": (0.91, (0.85, 1.15), 1e-3, 0.01, None),
          "faulty": (None, None, 1e-2, None, 0.8)}  # fmt: skip


def page(scores: dict[str, Score]) -> str:
    """The scores of some methods as one table; only whole tiers count, others say how many are there."""
    rows = []
    for method, found in scores.items():
        for row in found.table.filter(pl.col("quantity") == "all").iter_rows(named=True):
            named = [str(row[f"causes {word}"]) for word in ("right", "fair", "wrong", "none")]
            causes = ", ".join(named) if row["tier"] == "faulty" else ""
            rows.append([method, row["tier"], _count(row), *_numbers(row), causes])
    return _table(["method", "tier", "campaigns", *_HEADS, "causes right, fair, wrong, none"], rows)


def failures(found: Score) -> str:
    """The values of a method that are wrong with confidence: by fault, campaign and quantity.

    A dagger marks campaigns whose faults their recordings do not show.
    """
    rows = []
    for row in found.wrong.sort("faults", "campaign", "quantity", nulls_last=True).iter_rows(named=True):
        faults = f"{row['faults']}{' †' if row['unseen'] else ''}" if row["faults"] else "none"
        number = f"{row['off']:+.1f}", row["test"], f"{row['frequency [Hz]']:g}"
        rows.append([faults, row["tier"], row["campaign"], row["quantity"], str(row["values"]), *number])
    heads = ["faults", "tier", "campaign", "quantity", "values", "worst, in u", "test", "frequency [Hz]"]
    return _table(heads, rows)


def benchmark(scores: dict[str, Score], _: pl.DataFrame) -> str:
    """The failures of Fourpole's joint route, then the scores of all methods."""
    parts = ["### Values of Fourpole that are wrong with confidence", failures(scores[OWN])] if OWN in scores else []
    return "\n".join([*parts, "### Scores", page(scores)])


def validation(scores: dict[str, Score], laboratories: pl.DataFrame) -> str:
    """Coverage, rms z and confident wrong values of Fourpole: against the goals, by route, quantity, rig, specimen."""
    own = scores[OWN]
    whole, by_quantity = (own.table.filter((pl.col("quantity") == "all") == one) for one in (True, False))
    goals = [[row["tier"], _count(row), _missed(row) or "all", *_held(row)] for row in whole.iter_rows(named=True)]
    routes = [
        [name, row["tier"], _count(row), *_held(row)]
        for name, found in scores.items() if name.startswith("fourpole")
        for row in found.table.filter(quantity="all").iter_rows(named=True)
    ]  # fmt: skip
    parts = ["### Against the goals", _table(["tier", "campaigns", "goals reached", *_HELD], goals)]
    parts += ["### By route", _table(["method", "tier", "campaigns", *_HELD], routes)]
    found = [[row["tier"], row["quantity"], *_held(row)] for row in by_quantity.iter_rows(named=True)]
    parts += ["### Joint route, by quantity", _table(["tier", "quantity", *_HELD], found)]
    rows = own.rows.join(laboratories, on="campaign")
    order = list(dict.fromkeys(rows["tier"]))
    for head in ("rig", "specimen"):
        groups = [(*key, summary(part)) for key, part in rows.group_by("tier", head)]
        groups.sort(key=lambda group: (order.index(group[0]), group[1]))
        found = [[tier, name, str(row["campaigns"]), *_held(row)] for tier, name, row in groups]
        parts += [f"### Joint route, by {head}", _table(["tier", head, "campaigns", *_HELD], found)]
    return "\n".join(parts)


def faults(scores: dict[str, Score], laboratories: pl.DataFrame) -> str:
    """What Fourpole names where nothing is wrong, and for each fault: the campaigns with it, causes, wrong values."""
    own = scores[OWN]
    by_campaign = own.rows.group_by("campaign").agg(
        pl.len().alias("values"), (pl.col("verdict") == "ok").sum().alias("ok"), pl.col("confident").sum(),
        pl.col("off").filter(pl.col("verdict") == "ok").abs().max().alias("worst"),
    )  # fmt: skip
    campaigns = own.causes.join(by_campaign, on="campaign").join(laboratories, on="campaign")
    honest = [
        [tier, str(part.height), str((part["named"] != "").sum()), str(part["confident"].gt(0).sum())]
        for tier in ("honest", "ordinary")
        if (part := campaigns.filter(tier=tier)).height
    ]
    rows, order = [], list(FAULTS)
    for row in own.faults.join(campaigns, on="campaign").iter_rows(named=True):
        others = [name for name in own.faults.filter(campaign=row["campaign"])["fault"] if name != row["fault"]]
        size = sized(row["fault"], row["size"])
        hidden = " †" if "none" in (row["alike"] or "") else ""
        title = f"{row['fault']}{', ' if size else ''}{size}{hidden}"
        worst = "" if row["worst"] is None else f"{row['worst']:.1f}"
        place = f"{row['rig']}; {row['specimen']}; {row['recordings']}"
        said = row["said"].replace("|", "\\|").replace("*", "\\*") or "nothing"
        cells = [title, said, row["named"], row["judgement"], f"{row['ok']} of {row['values']}", str(row["confident"]),
                 worst, ", ".join(others), row["campaign"], place]  # fmt: skip
        rows.append((order.index(row["fault"]), row["campaign"], cells))
    heads = ["fault", "what is said first", "named, best first", "judgement", "ok", "of these wrong", "worst, in u",
             "together with", "campaign", "laboratory"]  # fmt: skip
    faulty = campaigns.filter(pl.col("tier") == "faulty")
    named = [str((faulty["judgement"] == word).sum()) for word in ("right", "fair", "wrong", "none")]
    counted = "The cause is right in {}, fair in {}, wrong in {}, and none is named in {} of {} campaigns.\n"
    return "\n".join([
        "### Without a fault",
        _table(["tier", "campaigns", "with a cause named", "with a value wrong with confidence"], honest),
        "### With faults", counted.format(*named, faulty.height),
        _table(heads, [cells for _, _, cells in sorted(rows)]),
    ])  # fmt: skip


#: Tables between the marks of a page, by its name.
PAGES = {"benchmark": benchmark, "validation": validation, "faults": faults}


def _missed(row: dict[str, object]) -> str:
    """Which goals of its tier a row does not reach; blank if all are reached."""
    least, scatter, values, campaigns, causes = _GOALS[str(row["tier"])]
    missed = []
    if least and not (row["coverage"] >= least and row["coverage, low"] <= 0.95 <= row["coverage, high"]):
        missed.append("coverage")
    if scatter and not scatter[0] <= row["rms z"] <= scatter[1]:
        missed.append("rms z")
    if row["confident wrong values"] > values:
        missed.append("wrong values")
    if campaigns and row["campaigns with one"] > campaigns * row["campaigns"]:
        missed.append("wrong campaigns")
    if causes and row["causes right"] + row["causes fair"] < causes * row["campaigns"]:
        missed.append("causes")
    return f"all but {', '.join(missed)}" if missed else ""


def _count(row: dict[str, object]) -> str:
    return f"{row['campaigns']}" if row["campaigns"] == row["of"] else f"{row['campaigns']} of {row['of']}"


def _numbers(row: dict[str, object]) -> list[str]:
    return ["" if row[key] is None else format(row[key], style) for _, key, style in _SHOWN]


def _held(row: dict[str, object]) -> list[str]:
    return [text for head, text in zip(_HEADS, _numbers(row), strict=True) if head in _HELD]


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    return "".join(f"| {' | '.join(cells)} |\n" for cells in (heads, ["---"] * len(heads), *rows))
