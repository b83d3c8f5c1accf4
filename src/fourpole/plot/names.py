"""Names and counts as figures and exports show them."""

from __future__ import annotations

import unicodedata
from collections.abc import Collection, Iterable, Iterator, Sequence

from fourpole.core.sources import Source
from fourpole.quantities import RIG_VALUES


def plain_text(text: str, longest: int = 24) -> str:
    """A text as figures show it: one line, without invisible characters, shortened in the middle if it is long.

    Examples
    --------
    >>> plain_text("a name that is much too long to be shown")
    'a name that is…be shown'
    """
    plain = "".join(sign if sign.isprintable() else " " for sign in unicodedata.normalize("NFC", text[:4000]))
    plain = " ".join(plain.split())
    if len(plain) > longest:
        tail = longest // 3
        plain = f"{plain[: longest - tail - 1].rstrip()}…{plain[-tail:].lstrip()}"
    return plain or "(no name)"


def short_names(names: Sequence[str], longest: int = 24) -> tuple[str, ...]:
    """Names as figures show them; equal names get a number.

    Examples
    --------
    >>> short_names(["a", "a ", "b"])
    ('a', 'a #2', 'b')
    """
    return tuple(distinct((plain_text(name, longest) for name in names), " #"))


def distinct(names: Iterable[str], mark: str, *, taken: Collection[str] = (), fold: bool = False) -> Iterator[str]:
    """The names made distinct: a name that occurred before or is in `taken` gets the mark and a number.

    With `fold`, names that differ only in upper and lower case count as equal.

    Examples
    --------
    >>> list(distinct(["a", "b", "a"], "_", taken=["b"]))
    ['a', 'b_2', 'a_2']
    """
    used = set(taken)
    for name in names:
        free, number = name, 1
        while (free.lower() if fold else free) in used:
            number += 1
            free = f"{name}{mark}{number}"
        used.add(free.lower() if fold else free)
        yield free


def counted(number: int, noun: str) -> str:
    """A number with its noun in singular or plural.

    Examples
    --------
    >>> counted(1, "test"), counted(2, "test")
    ('1 test', '2 tests')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


def lacking(number: int, what: str) -> list[str]:
    """The note that some tests have no value, if there are any.

    Examples
    --------
    >>> lacking(2, "TR"), lacking(0, "TR")
    (['2 tests have no TR'], [])
    """
    return [f"{counted(number, 'test')} {'has' if number == 1 else 'have'} no {what}"] if number else []


def value_label(source: Source) -> str:
    """A shared value, or a source of uncertainty, as figures name it.

    Examples
    --------
    >>> value_label(Source.read("moving_mass")), value_label(Source.read("loss angle block of radial"))
    ('moving mass m', 'δ block of radial')
    """
    value = RIG_VALUES.get(source.of)
    return value.name if value else plain_text(source.text.replace("_", " ").replace("loss angle", "δ"), 28)
