"""Remarks that differ in numbers and in the name of their test only, gathered under one of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from fourpole.core.wording import first_of, without_numbers

#: Tests with the same remark that are named.
_MOST_NAMED = 6


@dataclass(frozen=True)
class Alike:
    """Tests whose remark is the same but for numbers and name: their names, and the remark of the first."""

    names: list[str]
    remark: str
    same: bool

    @property
    def tests(self) -> str:
        """The number of tests and their names, or the name of the only one."""
        named = first_of(self.names, _MOST_NAMED)
        return named if len(self.names) == 1 else f"{len(self.names)} tests ({named})"

    @property
    def text(self) -> str:
        """The remark, and whose it is."""
        return self.remark if self.same else f"{self.remark} (this is {self.names[0]})"


def gathered_alike(remarks: Iterable[tuple[str, str]]) -> list[Alike]:
    """The remarks of some tests, each as name and text, those of more tests first.

    Examples
    --------
    >>> [one] = gathered_alike([("D1", "2.1 % off"), ("D2", "3 % off")])
    >>> one.tests, one.text
    ('2 tests (D1, D2)', '2.1 % off (this is D1)')
    """
    groups: dict[str, list[tuple[str, str]]] = {}
    for name, text in remarks:
        groups.setdefault(without_numbers(text.replace(name, "")), []).append((name, text))
    found = []
    for members in groups.values():
        same = len({text for _, text in members}) == 1
        found.append(Alike(list(dict.fromkeys(name for name, _ in members)), members[0][1], same))
    return sorted(found, key=lambda one: -len(one.names))
