"""Results that are held in memory while nothing on disk has changed, with what the components of the report show."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Generic, TypeVar

from fourpole.campaign import Campaign, read_campaign
from fourpole.campaign.folder import LIMITS
from fourpole.findings import by_size, findings
from fourpole.io.published import Published
from fourpole.plot import FIGURES
from fourpole.report.page import ReportFigure, page_parts
from fourpole.report.words.sentence import sentences
from fourpole.served.workspace import Place
from fourpole.study.results import read_results
from fourpole.study.study import Study

Made = TypeVar("Made")
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
        parts = page_parts(self.results, findings=found, figures=figures)
        return {**parts, "lacks_models": False}  # the page Model says so, and fits them

    @cached_property
    def cards(self) -> dict[str, Any]:
        """The card of each test, by the name of the test, in their order."""
        return {card.test: card for card in self.parts["cards"]}


class Latest(Generic[Made]):
    """What was asked for last, by keys, while the mark of its inputs stays the same."""

    def __init__(self, most: int) -> None:
        self._most, self._lock = most, threading.Lock()
        self._made: OrderedDict[Any, tuple[Any, Made]] = OrderedDict()

    def get(self, key: Any, mark: Any, make: Callable[[], Made]) -> Made:
        """What is held of a key with this mark, or else is made now."""
        with self._lock:
            held = self._made.get(key)
            if held is not None and held[0] == mark:
                self._made.move_to_end(key)
                return held[1]
        made = make()
        with self._lock:
            self._made[key] = (mark, made)
            self._made.move_to_end(key)
            while len(self._made) > self._most:
                self._made.popitem(last=False)
        return made


class Held:
    """The results and statements that were asked for last."""

    def __init__(self) -> None:
        self._campaigns: Latest[Campaign] = Latest(_MOST)
        self._shown: Latest[Shown] = Latest(_MOST)

    def of(self, place: Place) -> Shown | None:
        """The results of a campaign; None if it has none yet."""
        path = place.results / "study.json"
        try:
            stat = path.stat()
        except OSError:
            return None
        mark = (stat.st_mtime_ns, stat.st_size, stat.st_ino, _mark(place))
        return self._shown.get(place.key, mark, lambda: Shown(place, read_results(place.results)))

    def campaign(self, place: Place) -> Campaign:
        """The statement of a campaign, read again when its files change; CampaignError if it cannot be used."""
        files = [path for name in ("campaign.toml", "tests.csv", LIMITS) if (path := place.folder / name).is_file()]
        mark = tuple((path.stat().st_mtime_ns, path.stat().st_size) for path in files)
        return self._campaigns.get(place.key, mark, lambda: read_campaign(place.folder))


def _drawing(files: Published, name: str) -> str:
    """The text of a figure; what is no text in it is replaced."""
    return files.read(name, max_bytes=_MOST_BYTES).decode(errors="replace")


def _mark(place: Place) -> tuple[int, ...]:
    """When the models and maps beside the results changed."""
    times = []
    for name in ("model.json", "map.json"):
        try:
            times.append((place.results / name).stat().st_mtime_ns)
        except OSError:
            times.append(0)
    return tuple(times)
