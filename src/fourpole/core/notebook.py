"""What a notebook shows of an object: small HTML that needs no style sheet, no script and no other file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from fourpole.core.arrays import FloatArray

#: Rows that a table shows, characters of a cell, points of an outline.
_MOST_ROWS, _MOST_TEXT, _POINTS = 12, 300, 240
_CELL = "padding:1px 8px;text-align:right;white-space:nowrap"
_FIRST = "padding:1px 8px;text-align:left;white-space:nowrap"


def notebook_html(
    title: str,
    lines: Iterable[str] = (),
    heads: Sequence[str] = (),
    rows: Sequence[Sequence[str]] = (),
    *,
    total: int | None = None,
    most: int = _MOST_ROWS,
    after: str = "",
) -> str:
    """A title, lines of text and a table, whose texts are escaped.

    Parameters
    ----------
    title : str
    lines : iterable of str
        Lines above the table.
    heads : sequence of str
        Heads of the columns.
    rows : sequence of sequence of str
        Cells; of more rows than `most` the first ones are shown, and the number of the others.
    total : int, optional
        Number of all rows where `rows` has the first of them only.
    most : int
        Rows that are shown.
    after : str
        HTML below the table, as `outline_svg` makes it.

    Examples
    --------
    >>> notebook_html("a <b>", ["two"])
    '<div><b>a &lt;b&gt;</b><br>two</div>'
    """
    parts = [f"<b>{_text(title)}</b>", *map(_text, lines)]
    html = "<br>".join(parts)
    if rows:
        body = "".join(f"<tr>{_cells('td', row)}</tr>" for row in rows[:most])
        html += f"<table><thead><tr>{_cells('th', heads)}</tr></thead><tbody>{body}</tbody></table>"
    left = (len(rows) if total is None else total) - most
    if left > 0:
        html += f"... and {left} more"
    return f"<div>{html}{after}</div>"


def _cells(tag: str, texts: Sequence[str]) -> str:
    return "".join(f'<{tag} style="{_CELL if i else _FIRST}">{_text(text)}</{tag}>' for i, text in enumerate(texts))


def _text(text: str) -> str:
    return escape(text if len(text) <= _MOST_TEXT else f"{text[:_MOST_TEXT]}...")


def outline_svg(samples: FloatArray, *, width: int = 480, height: int = 48) -> str:
    """The least and greatest values along a signal as an SVG without text; empty for one without a value."""
    known = np.isfinite(samples)
    if not known.any():
        return ""
    low, high = float(samples[known].min()), float(samples[known].max())
    edges = np.unique(np.linspace(0, samples.size, _POINTS, endpoint=False).astype(int))
    ends = np.stack([np.fmin.reduceat(samples, edges), np.fmax.reduceat(samples, edges)], axis=1).ravel()
    x = np.repeat(edges / max(samples.size, 1) * width, 2)
    y = height - (ends - low) / ((high - low) or 1.0) * height
    places = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True) if np.isfinite(b))
    return (
        f'<svg width="{width}" height="{height + 4}" viewBox="0 -2 {width} {height + 4}">'
        f'<polyline points="{places}" fill="none" stroke="#0072b2" stroke-width="1"/></svg>'
    )
