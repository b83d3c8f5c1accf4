"""The score of a method: its values and causes against the truth, as one table and one page.

A method hands in two tables. ``values.csv`` has the columns campaign, test, frequency [Hz], quantity, value, lower,
upper, u, verdict; lower and upper are the ends of a 95 % interval, and verdict is ok, warning or rejected.
``causes.csv`` has campaign, rank, cause, channel or part; a row of rank 0 may have in
``said`` what the method says in words.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from elastomer_truth.drawing import TIERS, names, tier_of

KEY = ("campaign", "test", "frequency [Hz]", "quantity")
NUMBERS = ("value", "lower", "upper", "u")
#: A value is wrong with confidence if it is further off than this, in its standard uncertainty, and not flagged.
CONFIDENT = 4.0
#: What a blank or rejected value scores as: an interval over |K*|, and its weight beyond the ends, 2/0.05.
_BLANK, _BEYOND = (0.1, 10.0), 40.0
_DRAWS = 2000


@dataclass(frozen=True)
class Score:
    """What a method scored.

    Attributes
    ----------
    table, wrong, causes : DataFrame
        A row for each tier and quantity; the values that are wrong with confidence; the judgement on each campaign.
    rows, faults : DataFrame
        All values that are asked for, with the errors; the faults of all campaigns.
    """

    table: pl.DataFrame
    wrong: pl.DataFrame
    causes: pl.DataFrame
    rows: pl.DataFrame
    faults: pl.DataFrame


def read_truth(folder: Path, chosen: list[str] | None = None) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Values and faults of all campaigns, or of some, that are there."""
    found = [name for name in (chosen or names()) if (folder / name / "values.csv").exists()]
    if not found:
        raise FileNotFoundError(f"{folder}: no truth of any campaign is there; make it first")
    kinds = {"truth": pl.Float64, "frequency [Hz]": pl.Float64, "size": pl.Float64}
    tables = []
    for what in ("values", "causes"):
        parts = [pl.read_csv(folder / name / f"{what}.csv", infer_schema=False) for name in found]
        joined = pl.concat(parts)
        tables.append(joined.with_columns(pl.col(name).cast(kind) for name, kind in kinds.items() if name in joined))
    return tables[0], tables[1]


def read_laboratories(folder: Path, chosen: Iterable[str]) -> pl.DataFrame:
    """Rig, kind of the specimens and kinds of the recordings of some campaigns, in words."""
    found = []
    for name in chosen:
        lab = json.loads((folder / name / "laboratory.json").read_text(encoding="utf-8"))
        kinds = [test["kind"] for test in lab["tests"]]
        recordings = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        specimen = ", ".join({one["kind"]: 0 for one in lab["specimens"].values()})
        found.append((name, lab["rig"], specimen, recordings))
    return pl.DataFrame(found, schema=["campaign", "rig", "specimen", "recordings"], orient="row")


def read_answers(folder: Path) -> tuple[pl.DataFrame, pl.DataFrame]:
    """values.csv and causes.csv of a method; an error names the file and what is wrong."""
    tables = []
    for name, heads in (
        ("values.csv", (*KEY, *NUMBERS, "verdict")),
        ("causes.csv", ("campaign", "rank", "cause", "channel or part")),
    ):
        path = folder / name
        if not path.exists():
            raise FileNotFoundError(f"{path} is missing")
        table = pl.read_csv(path, infer_schema=False)
        if missing := [head for head in heads if head not in table.columns]:
            raise ValueError(f"{path}: the columns {', '.join(missing)} are missing")
        words = ["said"] if name == "causes.csv" else []
        table = table.with_columns(pl.lit("").alias(head) for head in words if head not in table.columns)
        tables.append(table.select(*heads, *words))
    number = pl.col("frequency [Hz]", *NUMBERS).cast(pl.Float64, strict=False)
    return tables[0].with_columns(number), tables[1].with_columns(pl.col("rank").cast(pl.Int64))


def score(truth: tuple[pl.DataFrame, pl.DataFrame], answers: tuple[pl.DataFrame, pl.DataFrame]) -> Score:
    """The score of a method against the truth of all campaigns of `truth`; the part of a tier counts as incomplete.

    Parameters
    ----------
    truth, answers : pair of DataFrame
        As `read_truth` and `read_answers` give them.
    """
    rows = _joined(truth[0], answers[0])
    faults = truth[1]
    judged = _judged(faults, answers[1], rows)
    table = []
    for tier, count in TIERS.items():
        own = rows.filter(pl.col("tier") == tier)
        if not own.height:
            continue
        for quantity in ("all", *own["quantity"].unique(maintain_order=True)):
            part = own if quantity == "all" else own.filter(pl.col("quantity") == quantity)
            table.append({"tier": tier, "quantity": quantity, "of": count, **summary(part)})
            if quantity == "all":
                named = judged.filter(pl.col("tier") == tier)["judgement"].to_list()
                table[-1] |= {f"causes {word}": named.count(word) for word in ("right", "fair", "wrong", "none")}
    said = faults.group_by("campaign").agg(
        pl.col("fault").str.join(", ").alias("faults"),
        pl.col("alike").fill_null("").str.contains("none").all().alias("unseen"),
    )
    wrong = (
        rows.filter(pl.col("confident")).join(said, on="campaign", how="left")
        .sort(pl.col("off").abs(), descending=True)
        .group_by("campaign", "quantity", maintain_order=True)
        .agg(pl.col("tier", "faults", "unseen", "test", "frequency [Hz]", "off").first(), pl.len().alias("values"))
        .select("tier", "campaign", "faults", "unseen", "quantity", "values", "off", "test", "frequency [Hz]")
    )  # fmt: skip
    return Score(pl.DataFrame(table, infer_schema_length=None), wrong, judged, rows, faults)


def _joined(truth: pl.DataFrame, answers: pl.DataFrame) -> pl.DataFrame:
    """The truth with what was answered, the interval score, and the error in u, a row for each value asked."""
    numbered = truth.with_row_index("row")
    keys = ["campaign", "test", "quantity"]
    near = (pl.col("frequency [Hz]") - pl.col("asked")).abs() <= 0.01 * pl.col("frequency [Hz]") + 1e-9
    given = answers.rename({"frequency [Hz]": "asked"}).with_columns(pl.col("asked").fill_null(0.0))
    matched = numbered.join(given, on=keys, how="inner").filter(near)
    matched = matched.unique("row", keep="first", maintain_order=True).select("row", *NUMBERS, "verdict")
    rows = numbered.join(matched, on="row", how="left")
    own = pl.col("truth").abs()
    squared = (pl.col("truth") ** 2).filter(pl.col("quantity").is_in(["K'", "K''"])).sum()
    stiffness = squared.over("campaign", "test", "frequency [Hz]").sqrt()
    is_stiffness = pl.col("quantity").is_in(["K'", "K''", "k21'", "k21''"])
    used = pl.col("value").is_finite() & (pl.col("verdict") != "rejected")
    rows = rows.with_columns(
        pl.when(is_stiffness).then(stiffness).otherwise(own).alias("scale"),
        used.fill_null(value=False).alias("answered"),
        pl.col("campaign").map_elements(tier_of, return_dtype=pl.String).alias("tier"),
    )
    bounded = pl.col("answered") & pl.col("lower").is_not_null() & pl.col("upper").is_not_null()
    low = pl.when(bounded).then("lower").otherwise(_BLANK[0] * pl.col("scale"))
    high = pl.when(bounded).then("upper").otherwise(_BLANK[1] * pl.col("scale"))
    x = pl.col("truth")
    beyond = (low - x).clip(lower_bound=0.0) + (x - high).clip(lower_bound=0.0)
    off = pl.when(pl.col("answered") & (pl.col("u") > 0)).then((pl.col("value") - x) / pl.col("u"))
    return rows.with_columns(
        bounded.alias("bounded"),
        ((high - low + _BEYOND * beyond) / pl.col("scale")).alias("interval score"),
        pl.when(bounded).then((low <= x) & (x <= high)).alias("held"),
        pl.when(pl.col("answered")).then((pl.col("value") - x).abs() / pl.col("scale")).alias("error"),
        off.alias("off"),
        pl.when(pl.col("verdict").is_not_null()).then(pl.col("verdict") != "ok").alias("flagged"),
    ).with_columns(
        ((pl.col("off").abs() > CONFIDENT) & (pl.col("verdict") == "ok")).fill_null(value=False).alias("confident")
    )


def summary(rows: pl.DataFrame) -> dict[str, float | int | None]:
    """The numbers of one tier and quantity; those that need an uncertainty are blank without one."""
    bounded = rows.filter(pl.col("bounded"))
    by_campaign = rows.group_by("campaign", maintain_order=True).agg(
        pl.col("interval score").mean(), pl.col("confident").any(), pl.col("held").sum(), pl.col("bounded").sum()
    )
    has = bounded.height > 0
    low, high = _range(by_campaign["held"].to_numpy(), by_campaign["bounded"].to_numpy()) if has else (None, None)
    z = rows["off"].drop_nulls().to_numpy()
    return {
        "campaigns": by_campaign.height,
        "values": rows.height,
        "answered": float(rows["answered"].mean()),  # type: ignore[arg-type]
        "median error": rows["error"].median(),  # type: ignore[dict-item]
        "coverage": float(bounded["held"].mean()) if has else None,  # type: ignore[arg-type]
        "coverage, low": low,
        "coverage, high": high,
        "rms z": float(np.sqrt(np.mean(z**2))) if z.size else None,
        "interval score": float(by_campaign["interval score"].median()) if has else None,  # type: ignore[arg-type]
        "confident wrong values": float(rows["confident"].mean()) if z.size else None,  # type: ignore[arg-type]
        "campaigns with one": int(by_campaign["confident"].sum()) if z.size else None,
        "flagged": rows["flagged"].mean(),  # type: ignore[dict-item]
    }


def _range(held: np.ndarray, count: np.ndarray) -> tuple[float, float]:
    """95 % range of the coverage by a bootstrap over campaigns."""
    rng = np.random.default_rng(1)
    chosen = rng.integers(len(held), size=(_DRAWS, len(held)))
    shares = held[chosen].sum(axis=1) / np.maximum(count[chosen].sum(axis=1), 1)
    low, high = np.quantile(shares, [0.025, 0.975])
    return float(low), float(high)


def _judged(faults: pl.DataFrame, named: pl.DataFrame, rows: pl.DataFrame) -> pl.DataFrame:
    """The judgement on the causes of each campaign: right, fair, wrong or none; one without faults has none at best."""
    judged = []
    for campaign in rows["campaign"].unique(maintain_order=True):
        own = faults.filter(pl.col("campaign") == campaign)
        given = named.filter((pl.col("campaign") == campaign) & pl.col("rank").is_between(1, 3)).sort("rank")
        said = [_text(cause, part) for cause, part in given.select("cause", "channel or part").iter_rows()]
        true = [_text(cause, part) for cause, part in own.select("cause", "channel or part").iter_rows()]
        alike = {name.strip() for text in own["alike"].fill_null("") for name in text.split("|") if name.strip()}
        if not said:
            judgement = "fair" if "none" in alike else "none"
        elif said[0] in true:
            judgement = "right"
        else:
            judgement = "fair" if set(said) & ({*true} | alike) else "wrong"
        words = "; ".join(named.filter(pl.col("campaign") == campaign, pl.col("rank") == 0)["said"].drop_nulls())
        judged.append((tier_of(campaign), campaign, ", ".join(true), ", ".join(said), judgement, words))
    heads = ["tier", "campaign", "true", "named", "judgement", "said"]
    return pl.DataFrame(judged, schema=heads, orient="row", infer_schema_length=None)


def _text(cause: str | None, part: str | None) -> str:
    return f"{cause or ''} {part or ''}".strip()
