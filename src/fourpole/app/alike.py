"""Remarks of many tests, those of one kind gathered."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass

from fourpole.words import first_of

#: Tests with the same remark that are named.
_MOST_ALIKE = 6


@dataclass(frozen=True)
class Alike:
    """Tests whose remarks are of one kind: their names, and the remark of the first."""

    names: list[str]
    remark: str
    same: bool

    @property
    def tests(self) -> str:
        """The number of tests and their names, or the name of the only one."""
        named = first_of(self.names, _MOST_ALIKE)
        return named if len(self.names) == 1 else f"{len(self.names)} tests ({named})"

    @property
    def text(self) -> str:
        """The remark, and whose it is."""
        return self.remark if self.same else f"{self.remark} (this is {self.names[0]})"


def gathered_alike(remarks: Iterable[tuple[str, Hashable, str]]) -> list[Alike]:
    """The remarks of some tests, each as name, kind and text, those of more tests first.

    Examples
    --------
    >>> [alike] = gathered_alike([("D1", "off", "2.1 % off"), ("D2", "off", "3 % off")])
    >>> alike.tests, alike.text
    ('2 tests (D1, D2)', '2.1 % off (this is D1)')
    """
    groups: dict[Hashable, dict[str, list[str]]] = {}
    for name, kind, text in remarks:
        groups.setdefault(kind, {}).setdefault(name, []).append(text)
    found = []
    for members in groups.values():
        texts = [text for of_name in members.values() for text in of_name]
        found.append(Alike(list(members), texts[0], len(set(texts)) == 1))
    return sorted(found, key=lambda alike: -len(alike.names))
