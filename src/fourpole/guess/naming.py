"""Names of the tests of a folder, and what a stated pattern takes from the names of its recordings."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from fourpole.errors import CampaignError
from fourpole.guess.gather import FolderContents, FolderRecording
from fourpole.guess.names import without_ending
from fourpole.guess.pattern import NamePattern
from fourpole.units import shown

#: File names that serve as names of tests.
_NAMES_LIKE = re.compile(r"\w[^,;\"'|]{0,59}")


def named_by(patterns: Sequence[NamePattern], gathered: FolderContents) -> list[int]:
    """Give each recording the tokens of the first pattern that its name matches, else none; the indices of the latter.

    CampaignError if no name matches.
    """
    unmatched: list[int] = []
    for index, one in enumerate(gathered.recordings):
        tokens = next((found for each in patterns if (found := each.tokens(one.file)) is not None), None)
        if tokens is None:
            unmatched.append(index)
        gathered.recordings[index] = replace(one, name=tokens or ())
    if len(unmatched) == len(gathered.recordings):
        stated = " or ".join(shown(one.stated, 100) for one in patterns)
        first = shown(gathered.recordings[0].file, 100)
        raise CampaignError(f"--pattern {stated}: matches the name of no recording; the first one is {first}")
    return unmatched


def test_names(recordings: Sequence[FolderRecording], kinds: Sequence[str]) -> list[str]:
    """Names of the tests: those of their files or groups, with as many folders before them as make them differ.

    S1, D1, C1 ... if file names are long, unusual, or differ in letter case alone.
    """
    stated = [next((token.text for token in one.name if token.what == "test"), "") for one in recordings]
    if all(stated) and len(set(stated)) == len(stated):
        return stated
    parts = [_parts_of(one.file) for one in recordings]
    for depth in range(1, max(map(len, parts)) + 1):
        names = [" ".join(own[-depth:]) for own in parts]
        if len({name.casefold() for name in names}) == len(names):
            break
    if len({name.casefold() for name in names}) == len(names) and all(map(_NAMES_LIKE.fullmatch, names)):
        return names
    counts: Counter[str] = Counter()
    numbered = []
    for kind in kinds:
        letter = {"static": "S", "calibration": "C"}.get(kind, "D")
        counts[letter] += 1
        numbered.append(f"{letter}{counts[letter]}")
    return numbered


def _parts_of(file: str) -> list[str]:
    """Folders, name without ending and group of a recording; a comma becomes a point, as in "2,1 bar"."""
    path, _, group = file.partition("#")
    *folders, name = path.split("/")
    parts = [*folders, without_ending(name), *([group.rpartition("/")[2]] if group else [])]
    return [re.sub(r"(?<=\d),(?=\d)", ".", part) for part in parts]
