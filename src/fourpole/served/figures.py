"""Figures of the catalogue on a page: drawn one at a time; points lead to recordings, and values are a table."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest

from markupsafe import Markup

from fourpole import quantities as q
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import number, with_std
from fourpole.plot import FIGURES, draw, figure_data, render
from fourpole.plot.cards import dynamic_cards, static_cards
from fourpole.plot.catalogue import spec_of
from fourpole.plot.data import Panel, Role, Series
from fourpole.plot.sheet import texts
from fourpole.report.page import ReportFigure
from fourpole.served.held import Shown
from fourpole.served.site import Site, address
from fourpole.study.study import Study

#: A link in a figure to the card of a test.
_CARD = re.compile(r'xlink:href="#([\w-]+)"')
#: Largest number of rows of the tables below a figure.
_MOST_ROWS = 2000


class LinkedFigure:
    """A figure of the report whose points lead to the recordings of their tests."""

    def __init__(self, figure: ReportFigure, shown: Shown) -> None:
        self.title, self.caption, self.address, self.size = figure.title, figure.caption, figure.address, figure.size
        drawing = figure.inline
        self.inline = None if drawing is None else linked(drawing, shown)


def linked(drawing: Markup, shown: Shown) -> Markup:
    """A drawing whose links to cards of tests are links to their recordings."""
    results = shown.results
    tests = {card: test for test, card in static_cards(results).items()}
    tests |= dict(zip(dynamic_cards(results), texts(results.dynamic, q.TEST.head), strict=True))

    def place_of(found: re.Match[str]) -> str:
        test = tests.get(found[1])
        return found[0] if test is None else f'xlink:href="{address(shown.place, "tests", test)}"'

    return Markup(_CARD.sub(place_of, drawing))


def drawn(site: Site, results: Study, key: str, form: str = "svg") -> bytes | None:
    """A figure of the catalogue as a file; None if the results hold nothing that it shows."""
    with site.drawing:
        figure = draw(results, key)
        return None if figure is None else render(figure, key, form)


def figure_of(site: Site, shown: Shown, results: Study, key: str) -> LinkedFigure | None:
    """A figure of the catalogue for a page; `results` are those of `shown`, or a part of them."""
    svg = drawn(site, results, key)
    if svg is None:
        return None
    spec = spec_of(key)
    return LinkedFigure(ReportFigure(key, spec.title, spec.caption, svg.decode(), spec.number), shown)


@dataclass(frozen=True)
class Values:
    """The tests of one panel of a figure: name and unit of both axes, and a row for each test."""

    title: str
    x: str
    y: str
    rows: list[tuple[str, str, str, str]]


def values_of(results: Study, key: str) -> list[Values]:
    """The tests that a figure shows, panel by panel; none for line art, which has no axes."""
    if key in FIGURES and FIGURES[key].data is None:
        return []
    data = figure_data(results, key)
    found, left = [], _MOST_ROWS
    for panel in () if data is None else data.panels:
        rows = list(_rows(panel))[:left]
        left -= len(rows)
        if rows:
            found.append(
                Values(", ".join(filter(None, (panel.title, panel.right))), panel.x.label, panel.y.label, rows)
            )
    return found


def _rows(panel: Panel) -> Iterator[tuple[str, str, str, str]]:
    """Name of the test, verdict if it is rejected, and both values as text."""
    for one in panel.series:
        if one.role in (Role.POINTS, Role.REJECTED) and one.tests and not panel.names:
            verdict = "rejected" if one.role is Role.REJECTED else ""
            yield from zip(one.tests, [verdict] * len(one.tests), _texts(one, "x"), _texts(one, "y"), strict=True)


def _texts(one: Series, which: str) -> Iterator[str]:
    values, stds = (one.x, one.across) if which == "x" else (one.y, one.spread)
    for value, std in zip_longest(values.tolist(), [] if stds is None else stds.tolist()):
        known = std is not None and std > 0
        text, about = with_std(value, COVERAGE_FACTOR * std) if known else (number(value, 5), "")
        yield f"{text} ± {about}" if about else text
