"""Numbers as text, with as many digits as their uncertainty allows, and small HTML for notebooks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from fourpole.core.arrays import FloatArray

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def known(value: object) -> float | None:
    """A finite number, or None."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def number(value: object, digits: int = 4) -> str:
    """A number to some significant digits; blank where there is none.

    >>> number(9.98918), number(-0.00012345, 3), number(1.5e9), number(None)
    ('9.989', '−0.000123', '1.500×10⁹', '')
    """
    finite = known(value)
    if finite is None:
        return ""
    if finite == 0:
        return "0"
    power = _power(finite, digits)
    if -4 <= power < 7:
        return fixed(finite, digits - 1 - power)
    return f"{fixed(finite / 10.0**power, digits - 1)}×10{str(power).translate(_SUPERSCRIPT)}"


def with_std(value: object, std: object, digits: int = 4) -> tuple[str, str]:
    """A number and its standard uncertainty, both to the second digit of the uncertainty; blank where unknown.

    >>> with_std(172.3482, 0.619), with_std(1105.36, 667.0), with_std(0.30366, None)
    (('172.35', '0.62'), ('1110', '670'), ('0.3037', ''))
    >>> with_std(1.04691e7, 4757580.0)
    ('1.047×10⁷', '4800000')
    """
    finite, u = known(value), known(std)
    if finite is None or not u or u < 0:
        return number(finite, digits), ""
    decimals = 1 - _power(u, 2)
    if decimals > 9 or abs(finite) >= 1e7:
        return number(finite, digits), number(round(u, decimals), 2)
    return fixed(round(finite, decimals), decimals), fixed(round(u, decimals), decimals)


def _power(value: float, digits: int) -> int:
    """Power of ten of a number once it is rounded."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2])


def fixed(value: float, decimals: int) -> str:
    """A number with this many decimals, and a true minus sign; zero has none."""
    text = f"{value:.{max(0, decimals)}f}".replace("-", "−")
    return text.lstrip("−") if not text.strip("−0.") else text


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
