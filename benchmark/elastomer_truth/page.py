"""Scores as one page of Markdown."""

from __future__ import annotations

import polars as pl

from elastomer_truth.score import Score

#: Columns of the page: the head, the column of the table, and how it is shown.
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


def page(scores: dict[str, Score]) -> str:
    """The scores of some methods as one page of Markdown; only whole tiers count, others say how many are there."""
    heads = ["method", "tier", "campaigns", *(head for head, _, _ in _SHOWN), "causes right, fair, wrong, none"]
    lines = [_row(heads), _row(["---"] * len(heads))]
    for method, found in scores.items():
        for row in found.table.filter(pl.col("quantity") == "all").iter_rows(named=True):
            part = "" if row["campaigns"] == row["of"] else f" of {row['of']}"
            cells = ["" if row[key] is None else format(row[key], style) for _, key, style in _SHOWN]
            named = [str(row[f"causes {word}"]) for word in ("right", "fair", "wrong", "none")]
            causes = ", ".join(named) if row["tier"] == "faulty" else ""
            lines.append(_row([method, row["tier"], f"{row['campaigns']}{part}", *cells, causes]))
    return "\n".join(lines) + "\n"


def failures(found: Score) -> str:
    """The values of a method that are wrong with confidence as a table of Markdown: by campaign and quantity.

    A dagger marks campaigns whose faults their recordings do not show.
    """
    heads = ["faults", "tier", "campaign", "quantity", "values", "worst, in u", "test", "frequency [Hz]"]
    lines = [_row(heads), _row(["---"] * len(heads))]
    for row in found.wrong.sort("faults", "campaign", "quantity", nulls_last=True).iter_rows(named=True):
        faults = f"{row['faults']}{' †' if row['unseen'] else ''}" if row["faults"] else "none"
        number = f"{row['off']:+.1f}", row["test"], f"{row['frequency [Hz]']:g}"
        lines.append(_row([faults, row["tier"], row["campaign"], row["quantity"], str(row["values"]), *number]))
    return "\n".join(lines) + "\n"


def causes(found: Score) -> str:
    """What a method names in each campaign with faults, and the judgement on it."""
    heads = ["campaign", "true", "named, best first", "judgement"]
    lines = [_row(heads), _row(["---"] * len(heads))]
    faulty = found.causes.filter(pl.col("tier") == "faulty")
    lines += [_row(list(row)) for row in faulty.select("campaign", "true", "named", "judgement").iter_rows()]
    return "\n".join(lines) + "\n"


def quantities(found: Score) -> str:
    """The score of one method by quantity."""
    heads = ["tier", "quantity", *(head for head, _, _ in _SHOWN)]
    lines = [_row(heads), _row(["---"] * len(heads))]
    for row in found.table.filter(pl.col("quantity") != "all").iter_rows(named=True):
        cells = ["" if row[key] is None else format(row[key], style) for _, key, style in _SHOWN]
        lines.append(_row([row["tier"], row["quantity"], *cells]))
    return "\n".join(lines) + "\n"


def report(scores: dict[str, Score]) -> str:
    """All tables: Fourpole's failures first, then the scores, Fourpole's by quantity, and its causes."""
    parts = []
    own = next((found for name, found in scores.items() if name == "fourpole joint"), None)
    if own is not None:
        parts += ["### Values of Fourpole that are wrong with confidence", failures(own)]
    parts += ["### Scores", page(scores)]
    if own is not None:
        parts += ["### Fourpole, joint route, by quantity", quantities(own)]
        parts += ["### Causes that Fourpole names", causes(own)]
    return "\n".join(parts)


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"
