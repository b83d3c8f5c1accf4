"""Results that are held in memory while nothing on disk has changed, with what the components of the report show."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from fourpole.campaign import Campaign, read_campaign
from fourpole.campaign.folder import LIMITS
from fourpole.findings import by_size, findings
from fourpole.io.published import Published
from fourpole.plot import FIGURES
from fourpole.report.digits import in_units
from fourpole.report.page import ReportFigure, page_parts
from fourpole.report.words.sentence import sentences
from fourpole.served.workspace import Place
from fourpole.study.results import read_results
from fourpole.study.study import Study

#: Number of campaigns whose results are held.
_MOST = 6
#: Largest figure that is shown [byte].
_MOST_BYTES = 20_000_000


@dataclass(eq=False)
class Shown:
    """The results of a campaign, and what the report shows of them."""

    place: Place
    results: Study
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    @cached_property
    def parts(self) -> dict[str, Any]:
        """What the templates of the report show."""
        files = self.results.files
        figures = {
            key: ReportFigure(key, spec.title, spec.caption, _drawing(files, f"figures/{key}.svg"), spec.number)
            for key, spec in FIGURES.items()
            if files is not None and files.has(f"figures/{key}.svg")
        }
        found = sentences(by_size(findings(self.results)), self.results.shown)
        with in_units(self.results.shown):
            parts = page_parts(self.results, findings=found, figures=figures)
        return {**parts, "lacks_models": False}  # the page Model says so, and fits them

    @cached_property
    def cards(self) -> dict[str, Any]:
        """The card of each test, by the name of the test, in their order."""
        return {card.test: card for card in self.parts["cards"]}


class Held:
    """The results that were asked for last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._campaigns: OrderedDict[str, tuple[Any, Campaign]] = OrderedDict()
        self._shown: OrderedDict[str, tuple[Any, Shown]] = OrderedDict()

    def of(self, place: Place) -> Shown | None:
        """The results of a campaign; None if it has none yet."""
        path = place.results / "study.json"
        try:
            stat = path.stat()
        except OSError:
            return None
        mark = (stat.st_mtime_ns, stat.st_size, stat.st_ino, _mark(place))
        with self._lock:
            found = self._shown.get(place.key)
            if found is not None and found[0] == mark:
                self._shown.move_to_end(place.key)
                return found[1]
        shown = Shown(place, read_results(place.results))
        with self._lock:
            self._shown[place.key] = (mark, shown)
            while len(self._shown) > _MOST:
                self._shown.popitem(last=False)
        return shown

    def campaign(self, place: Place) -> Campaign:
        """The statement of a campaign, read again when its files change; CampaignError if it cannot be used."""
        mark = tuple((path.stat().st_mtime_ns, path.stat().st_size) for path in _statement(place))
        with self._lock:
            found = self._campaigns.get(place.key)
            if found is not None and found[0] == mark:
                return found[1]
        campaign = read_campaign(place.folder)
        with self._lock:
            self._campaigns[place.key] = (mark, campaign)
            while len(self._campaigns) > _MOST:
                self._campaigns.popitem(last=False)
        return campaign


def _drawing(files: Published, name: str) -> str:
    """The text of a figure; what is no text in it is replaced."""
    return files.read(name, max_bytes=_MOST_BYTES).decode(errors="replace")


def _statement(place: Place) -> list[Path]:
    return [path for name in ("campaign.toml", "tests.csv", LIMITS) if (path := place.folder / name).is_file()]


def _mark(place: Place) -> tuple[int, ...]:
    """When the models and maps beside the results changed."""
    times = []
    for name in ("model.json", "map.json"):
        try:
            times.append((place.results / name).stat().st_mtime_ns)
        except OSError:
            times.append(0)
    return tuple(times)
