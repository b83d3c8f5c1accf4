"""Worst inputs of the regular expressions: texts of repeated pieces that a pattern nearly matches.

    python fuzz/fuzz_patterns.py [--seed 0] [--tries 400] [--only io/layout]

Prints for each pattern the slowest text (before, repeated, after) with its time per character, slowest first.
A new pattern's line goes into the table of tests/test_patterns.py.
"""

from __future__ import annotations

import argparse
import random
import re._constants as sre
import re._parser as parser
import signal
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.patterns import Use, seconds, uses

LENGTH = 16_000
TIME_LIMIT = 2
USUAL = "a1 ,.;:=[](){}<>/\\\"'-_eEZ\t\n#!+$é字\x00"
LAST = ("", "\x00", "!", "a", "1", "Z ", "\n~", "]", "é", ",", "\t")
OF_CATEGORY = {
    sre.CATEGORY_DIGIT: "19",
    sre.CATEGORY_SPACE: " \t\n",
    sre.CATEGORY_WORD: "a1_",
    sre.CATEGORY_NOT_DIGIT: "a ",
    sre.CATEGORY_NOT_SPACE: "a1",
    sre.CATEGORY_NOT_WORD: " -",
}
REPEATS = (sre.MAX_REPEAT, sre.MIN_REPEAT, sre.POSSESSIVE_REPEAT)


class Overdue(BaseException):
    """A pattern took longer than a quadratic one would."""


def letters(members: list[Any]) -> str:
    """Some characters of a class."""
    listed = ""
    for code, given in members:
        if code is sre.LITERAL:
            listed += chr(given)
        elif code is sre.RANGE:
            listed += chr(given[0]) + chr(given[1])
        elif code is sre.CATEGORY:
            listed += OF_CATEGORY[given]
    if members[0][0] is sre.NEGATE:
        return "".join(one for one in USUAL if one not in listed) or "é"
    return listed


def matching(parts: Iterable[Any], chance: random.Random) -> str:
    """A text that some parts of a pattern match, but for what stands around them."""
    text = ""
    for code, given in parts:
        if code is sre.LITERAL:
            text += chr(given)
        elif code in (sre.NOT_LITERAL, sre.ANY):
            text += chance.choice("a1 ,")
        elif code is sre.IN:
            text += chance.choice(letters(given))
        elif code in REPEATS:
            least, most, inner = given
            text += "".join(matching(inner, chance) for _ in range(chance.randint(least, min(least + 2, int(most)))))
        elif code is sre.BRANCH:
            text += matching(chance.choice(given[1]), chance)
        elif code in (sre.SUBPATTERN, sre.ATOMIC_GROUP):
            text += matching(given[3] if code is sre.SUBPATTERN else given, chance)
    return text


def repeated(parts: Iterable[Any], before: list[Any]) -> Iterator[tuple[list[Any], list[Any]]]:
    """The repeated parts of a pattern, each with the parts before it."""
    for part in parts:
        code, given = part
        inner: list[list[Any]] = []
        if code in REPEATS:
            yield before, list(given[2])
            inner = [list(given[2])]
        elif code is sre.BRANCH:
            inner = [list(one) for one in given[1]]
        elif code in (sre.SUBPATTERN, sre.ATOMIC_GROUP):
            inner = [list(given[3] if code is sre.SUBPATTERN else given)]
        for one in inner:
            yield from repeated(one, before)
        before = [*before, part]


def worst_input(use: Use, chance: random.Random, tries: int) -> tuple[float, tuple[str, str, str]]:
    """The largest time per character [s], and the text that takes it."""
    tree = list(parser.parse(use.pattern.pattern, use.pattern.flags & ~256))
    places = list(repeated(tree, [])) or [([], tree)]
    worst = (0.0, ("", "a", ""))
    pieces = ["a", "1", " "]
    for _ in range(tries):
        before, inner = chance.choice(places)
        first, piece = matching(before, chance), matching(inner, chance) or "a"
        kind = chance.randrange(5)
        if kind == 1:
            first, piece = "", first + piece
        elif kind == 2:
            first, piece = "", matching(tree, chance) or "a"
        elif kind == 3:
            first, piece = "", chance.choice(USUAL)
        elif kind == 4:
            first, piece = "", piece + chance.choice(pieces)
        pieces.append(piece)
        last = chance.choice([*LAST, matching(tree, chance)])
        text = first + piece * (LENGTH // len(piece)) + last
        signal.setitimer(signal.ITIMER_PROF, TIME_LIMIT)
        try:
            taken = seconds(use, text) / len(text)
        except Overdue:
            taken = float("inf")
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
        if taken > worst[0]:
            worst = taken, (first, piece, last)
        if taken == float("inf"):
            break
    return worst


def _overdue(*_: object) -> None:
    raise Overdue


def main() -> int:
    arguments = argparse.ArgumentParser(description="Worst inputs of the regular expressions.")
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--tries", type=int, default=400)
    arguments.add_argument("--only", default="")
    asked = arguments.parse_args()
    signal.signal(signal.SIGPROF, _overdue)
    lines = []
    for key, several in uses().items():
        if key.startswith(asked.only):
            chance = random.Random(f"{asked.seed} {key}")
            each = [worst_input(one, chance, asked.tries) for one in several if one.pattern is not None]
            lines += [(*max(each), key)] if each else []
    for taken, worst, key in sorted(lines, reverse=True):
        print(f"{1e6 * taken:9.3f} µs  {key}: {worst!r}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
