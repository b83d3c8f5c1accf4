"""The sentences below a figure."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from fourpole.core.arrays import BoolArray
from fourpole.plot.names import counted
from fourpole.plot.sheet import spread

_T = TypeVar("_T")


@dataclass
class Notes:
    """Sentences below a figure, chiefly on what it does not show."""

    lines: list[str] = field(default_factory=list)

    def say(self, text: str) -> None:
        """Add a sentence once."""
        if text and text not in self.lines:
            self.lines.append(text)

    def chosen(self, shown: int, of: int, what: str) -> None:
        """Add that only some of several conditions are drawn, if so."""
        if shown < of:
            self.say(f"{shown} of {of} {what} shown")

    def some(self, found: list[_T], most: int, what: str) -> list[_T]:
        """At most `most` of several items, evenly spaced; adds a note if not all are shown."""
        shown = [found[at] for at in spread(len(found), most)]
        self.chosen(len(shown), len(found), what)
        return shown

    def first(self, found: list[_T], most: int, what: str) -> list[_T]:
        """The first of several items, at most `most`; adds a note if not all are shown."""
        self.chosen(min(len(found), most), len(found), what)
        return found[:most]

    def tests(self, rejected: BoolArray, visible: BoolArray, what: str) -> None:
        """Add the numbers of rejected tests and of tests without a value; both masks have all tests of the figure."""
        count, hidden = int(rejected.sum()), int(np.sum(rejected & ~visible))
        if count:
            self.say(f"{counted(count, 'test')} rejected" + (f", {hidden} not shown: no value" if hidden else ""))
        lacking = int(np.sum(~rejected & ~visible))
        if lacking:
            self.say(f"{counted(lacking, 'test')} {'has' if lacking == 1 else 'have'} no {what}")
