"""What a study found, in a few sentences, each with its figures."""

from __future__ import annotations

import polars as pl

from fourpole.campaign.study import Study

__all__ = ["findings"]


def findings(study: Study) -> list[str]:
    """One sentence per tyre, and one that compares the first two where there are two.

    Parameters
    ----------
    study : Study
        An analysed campaign.

    Returns
    -------
    list of str
        Sentences; empty where no test could be used.
    """
    used = study.dynamic.filter(pl.col("verdict") != "rejected")
    tyres = used["tyre"].unique(maintain_order=True).to_list()
    lines = [_tyre(tyre, used.filter(pl.col("tyre") == tyre)) for tyre in tyres]
    if len(tyres) == 2:
        lines += _compared(used, *tyres)
    return lines


def _tyre(name: str, rows: pl.DataFrame) -> str:
    ranges = [
        _range("K1", rows["K1 [N/m]"], 1e3, "kN/m"),
        _range("K2", rows["K2 [N/m]"], 1e3, "kN/m"),
        _range("C", rows["C [N s/m]"], 1.0, "N s/m"),
    ]
    text = f"{name}: " + ", ".join(part for part in ranges if part)
    peaks = rows.filter(pl.col("TR measured [1]").is_not_null())
    if peaks.height:
        top = peaks.sort("TR measured [1]").tail(1)
        text += f"; largest TR {top['TR measured [1]'][0]:.2f} at {top['frequency [Hz]'][0]:.1f} Hz"
    return text


def _range(name: str, values: pl.Series, scale: float, unit: str) -> str:
    known = values.drop_nulls().to_numpy() / scale
    return f"{name} {known.min():.0f} to {known.max():.0f} {unit}" if known.size else ""


def _compared(used: pl.DataFrame, first: str, second: str) -> list[str]:
    """Mean ratios of two tyres over the conditions that they have in common."""
    nominal = pl.col("frequency [Hz]").round(0).alias("nominal")
    by = ["pressure [Pa]", "preload [N]", "nominal"]
    columns = ["K1 [N/m]", "K2 [N/m]", "C [N s/m]"]
    each = [used.filter(pl.col("tyre") == tyre).with_columns(nominal).select(*by, *columns) for tyre in (first, second)]
    pairs = each[0].join(each[1], on=by, suffix=" other").drop_nulls()
    if not pairs.height:
        return []
    ratios = [(pairs[name] / pairs[f"{name} other"]).to_numpy().mean() for name in columns]
    parts = ", ".join(f"{name.split()[0]} {ratio:.2f}" for name, ratio in zip(columns, ratios, strict=True))
    return [f"{first} over {second}, mean ratio in {pairs.height} conditions in common: {parts}"]
