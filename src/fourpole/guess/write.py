"""A guessed campaign as text: campaign.toml has the doubts as comments, tests.csv has a column of doubts."""

from __future__ import annotations

import csv
import io
import json
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fourpole import quantities as q
from fourpole.campaign.row import DOUBTS, doubts_cell
from fourpole.errors import CampaignError
from fourpole.guess.masses import shows_force
from fourpole.guess.names import CONDITIONS, MOVING_KINDS
from fourpole.io.lock import campaign_lock, staged
from fourpole.io.write import write_text
from fourpole.units import shown
from fourpole.words import package_toml
from fourpole.words.heads import Role

#: What `init` writes and asks, in words.
WORDS = package_toml("fourpole.guess")
#: Conditions whose columns tests.csv has even if all their cells are blank.
_ALWAYS = (q.PRESSURE, q.PRELOAD, q.FREQUENCY)
_ROLES = ("force_in", "motion_in", "motion_out", "load", "deflection", "reference")
#: Values of the rig by name: SI value of one unit, the unit, and an example; an empty example is not written.
RIG_VALUES = {
    "moving_mass": (1.0, "kg", "15 kg"),
    "preload_stiffness": (1e3, "kN/m", "12.44 kN/m"),
    "preload_damping": (1.0, "N s/m", ""),
}


@dataclass(frozen=True)
class Doubt:
    """A part of the guess that may be wrong or is missing.

    Attributes
    ----------
    about : str
        Subject of the doubt: a channel's role, a condition, "rig", "kind" or "files".
    text : str
        What was found and what was assumed.
    remedy : str
        How the user corrects a wrong guess.
    tests : tuple of str
        Names of the tests that the doubt is about; empty for a doubt on the whole campaign.
    """

    about: str
    text: str
    remedy: str
    tests: tuple[str, ...] = ()


@dataclass(frozen=True)
class Row:
    """One guessed row of tests.csv, in SI units; `band` [Hz] of many frequencies, `window` [s] of a part of a file.

    `doubts` are pairs of a subject, which may be a column, and a text.
    """

    name: str
    file: str
    kind: str
    tyre: str = ""
    values: dict[str, float] = field(default_factory=dict)
    repeat: str = ""
    doubts: tuple[tuple[str, str], ...] = ()
    band: tuple[float, float] | None = None
    window: tuple[float, float] | None = None
    segment: str = ""


@dataclass(frozen=True)
class GuessedCampaign:
    """A campaign guessed from a folder of recordings.

    Attributes
    ----------
    folder : Path
    title : str
    rows : tuple of Row
    roles : dict of str to Role
        The channels by role.
    clock : (str, str) or None
        Column of the time and its unit; None if the recordings state their times, or if no time is found.
    reference : (str, str, int) or None
        Column of a tacho or encoder, its unit, and its pulses per cycle (0 for an angle).
    rig : dict of str to float [SI]
        Values of the rig that names, headers and notes state.
    constructions : dict of str to str
        Construction by tyre; empty if it is not known.
    doubts : tuple of Doubt
    left_out : tuple of (str, str)
        Files that are no recordings, each with the reason.
    blocked : bool
        Whether the far side of the specimen is taken as fixed.
    """

    folder: Path
    title: str
    rows: tuple[Row, ...]
    roles: dict[str, Role]
    clock: tuple[str, str] | None
    reference: tuple[str, str, int] | None
    rig: dict[str, float]
    constructions: dict[str, str]
    doubts: tuple[Doubt, ...]
    left_out: tuple[tuple[str, str], ...]
    blocked: bool = False

    @property
    def moving(self) -> bool:
        """Whether a test is more than static."""
        return bool({row.kind for row in self.rows} & set(MOVING_KINDS))

    @property
    def questions(self) -> dict[str, str]:
        """What only the laboratory knows, by the key that states it: each answer makes results more certain."""
        if not self.moving:
            return {}
        asked = dict(WORDS["asked"])
        weighed = any(row.values.get("added_mass") for row in self.rows)
        if weighed or any(doubt.about == "far side" for doubt in self.doubts):
            del asked["added_mass"]
        elif shows_force(self.roles):
            asked |= WORDS["asked_of_mass"]
        return asked

    def write(self, *, force: bool = False) -> list[Path]:
        """Write campaign.toml and tests.csv and return their paths; CampaignError if one exists, unless `force`."""
        with campaign_lock(self.folder):
            if not force:
                keep_existing(self.folder)
            with staged(self.folder) as new:
                for name, text in zip(_WRITTEN, (campaign_toml(self), tests_csv(self.rows)), strict=True):
                    write_text(new / name, text)
        return [self.folder / name for name in _WRITTEN]


_WRITTEN = ("campaign.toml", "tests.csv")
#: Characters of a line of a comment, without its sign.
_WIDTH = 78


def keep_existing(folder: Path) -> None:
    """CampaignError if a folder has a campaign.toml, a tests.csv or a tests.xlsx."""
    there = [name for name in (*_WRITTEN, "tests.xlsx") if (folder / name).exists() or (folder / name).is_symlink()]
    if there:
        raise CampaignError(
            f"{shown(folder, 200)[1:-1]}: there is a {' and a '.join(there)} already, which nothing here changes: "
            "move it away, or use --force to replace it"
        )


def quoted(text: str) -> str:
    """A text as a basic string of TOML, in quotation marks."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def comment(text: str) -> str:
    """A text as comment lines of TOML; a blank replaces each character that cannot be printed."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    lines = textwrap.wrap(plain, _WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return "".join(f"# {line}\n" for line in lines)


def campaign_toml(guess: GuessedCampaign) -> str:
    """The text of campaign.toml."""
    statics = sum(row.kind == "static" for row in guess.rows)
    made = f"guessed by `fourpole init` from {len(guess.rows)} recordings, {statics} of them static"
    files = "".join(_doubts(guess, about) for about in ("files", "names"))
    head = comment(f"{made}; correct what is wrong") + files + f"title = {quoted(guess.title)}\n"
    questions, asked = WORDS["questions"] if guess.moving else "", guess.questions.get("added_mass")
    parts = [head, _rig(guess), _channels(guess), questions, comment(f"question: {asked}") if asked else ""]
    return "\n".join(filter(None, [*parts, *_tyres(guess), WORDS["report"]]))


def _doubts(guess: GuessedCampaign, about: str) -> str:
    """Comment lines with the doubts on a subject; those on a channel stand above its line, without a remedy."""
    return "".join(
        comment(f"doubt: {doubt.text}" + ("" if about in _ROLES else f"; {doubt.remedy}"))
        for doubt in guess.doubts
        if doubt.about == about
    )


def _rig(guess: GuessedCampaign) -> str:
    """[rig] with the values found; its lines are comments if the moving mass or the preload stiffness is missing."""
    if not any(row.kind != "static" for row in guess.rows) and not guess.rig:
        return ""
    if guess.blocked:
        return f'{_doubts(guess, "far side")}[rig]\noutput = "blocked"\n'
    whole = guess.rig.keys() >= ({"moving_mass"} if shows_force(guess.roles) else {"moving_mass", "preload_stiffness"})
    sign = "" if whole else "# "
    hint = "" if whole else "    # remove the # signs of this table when its values are yours"
    lines = [_doubts(guess, "rig"), f"{sign}[rig]{hint}\n"]
    for name, (scale, unit, example) in RIG_VALUES.items():
        value = guess.rig.get(name)
        if value is not None:
            lines.append(f'{sign}{name:<17} = "{value / scale:.12g} {unit}"\n')
        elif example:
            lines.append(f'# {name:<17} = "{example}"    # an example, not yours\n')
    if any(doubt.about == "far side" for doubt in guess.doubts):
        lines += [_doubts(guess, "far side"), '# output            = "blocked"    # needs no other value\n']
    return "".join(lines)


def _channels(guess: GuessedCampaign) -> str:
    """[channels]: the channels found, and a comment line for each missing channel that a test needs."""
    lines = ["[channels]\n", _doubts(guess, "time")]
    if guess.clock is not None:
        lines.append(f"time       = {{ column = {quoted(guess.clock[0])}, unit = {quoted(guess.clock[1])} }}\n")
    elif any(doubt.about == "time" for doubt in guess.doubts):
        lines.append('# sample_rate = "1000 Hz"\n')
    kinds = {row.kind for row in guess.rows}
    for role in _ROLES[:-1]:
        lines.append(_doubts(guess, role))
        if role in guess.roles:
            lines.append(_channel(guess.roles[role]))
        elif kinds & ({"static"} if role in ("load", "deflection") else set(MOVING_KINDS)):
            lines.append(f'# {role:<10} = {{ column = "...", unit = "..." }}\n')
    if "drive" in guess.roles:
        lines += [_doubts(guess, "drive"), f"drive      = {quoted(guess.roles['drive'].column)}\n"]
    if guess.reference is not None:
        name, unit, pulses = guess.reference
        lines.append(_doubts(guess, "reference"))
        lines.append(f"reference  = {{ column = {quoted(name)}, unit = {quoted(unit)}, pulses = {pulses} }}\n")
    return "".join(lines)


def _channel(role: Role) -> str:
    """The line of a channel; a comment line if its unit is not known."""
    sign = "# " if role.unit is None else ""
    keys = [f"column = {quoted(role.column)}"]
    keys.append(f"unit = {quoted(role.unit)}" if role.unit is not None else 'unit = "V", sensitivity = "..."')
    keys += ["invert = true"] if role.invert else []
    keys += [f"beside = [{', '.join(map(quoted, role.beside))}]"] if role.beside else []
    return f"{sign}{role.role:<10} = {{ {', '.join(keys)} }}\n"


def _tyres(guess: GuessedCampaign) -> list[str]:
    """The tables [tyres.NAME]; the doubts on tyres stand before the first one."""
    parts = [_doubts(guess, "tyre")] if any(doubt.about == "tyre" for doubt in guess.doubts) else []
    for name, construction in guess.constructions.items():
        key = name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else quoted(name)
        stated = f"construction = {quoted(construction)}\n" if construction else ""
        weight = (
            f'# specimen_mass = "9 kg"    # an example, not yours\n{comment(WORDS["weight"])}' if guess.moving else ""
        )
        parts.append(f"[tyres.{key}]\n{stated}{weight}")
    return ["".join(parts[:2]), *parts[2:]] if parts and parts[0].startswith("#") else parts


def tests_csv(rows: Sequence[Row]) -> str:
    """The text of tests.csv."""
    columns: dict[str, list[str]] = {
        head: [getattr(row, name) for row in rows]
        for head, name in (("test", "name"), ("file", "file"), ("kind", "kind"), ("tyre", "tyre"))
    }
    for one in CONDITIONS:
        cells = [_cell(row, one) for row in rows]
        if one in _ALWAYS or any(cells):
            columns[one.stated_head] = cells
    if any(row.window for row in rows):
        columns[q.WINDOW.head] = ["" if row.window is None else "{:g}..{:g}".format(*row.window) for row in rows]
        columns["segment"] = [row.segment for row in rows]
    if any(row.repeat for row in rows):
        columns["repeat"] = [row.repeat for row in rows]
    named = {head.partition(" ")[0]: cells for head, cells in columns.items()}
    doubts = [doubts_cell(_entries(row, at, named)) for at, row in enumerate(rows)]
    if any(doubts):
        columns[DOUBTS] = doubts
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([list(columns), *zip(*columns.values(), strict=True)])
    return text.getvalue()


def _entries(row: Row, at: int, columns: Mapping[str, Sequence[str]]) -> Iterator[tuple[str, str, str]]:
    """Column, guessed cell and text of each doubt on a row; the column is empty for another subject."""
    for about, text in row.doubts:
        cells = columns.get(about)
        yield ("", "", text) if cells is None else (about, cells[at], text)


def _cell(row: Row, one: q.Quantity) -> str:
    """The cell of a condition."""
    if one.key == "frequency" and row.band is not None:
        return f"{row.band[0]:g}:{row.band[1]:g}"
    return f"{row.values[one.key] / one.scale:.10g}" if one.key in row.values else ""
