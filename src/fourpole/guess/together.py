"""All that was seen of a folder put together: rows of tests.csv, channels, rig, and the doubts."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fourpole import units
from fourpole.errors import CampaignError
from fourpole.guess.channels import Column, Role, dynamic_roles, force_scale, static_roles
from fourpole.guess.conditions import Entry, Told, tell
from fourpole.guess.gather import FolderContents, Seen, gather
from fourpole.guess.names import kind_word, without_ending
from fourpole.guess.signals import SignalShape
from fourpole.guess.words import CONSTRUCTIONS
from fourpole.guess.write import Doubt, Guess, Row
from fourpole.units import shown

__all__ = ["guess_campaign"]

_SAME_FREQUENCY = 0.05
_NAMES_LIKE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,23}")
_RIG = ("moving_mass", "preload_stiffness", "preload_damping")
#: |K*| over the static slope that needs no word.
_LIKELY = (0.3, 12.0)


def guess_campaign(folder: str | Path, *, progress: Callable[[int, int], None] | None = None) -> Guess:
    """Guess a campaign from a folder of recordings in any format.

    Parameters
    ----------
    folder : path
        Recordings, in it or below it.
    progress : callable (done, total)
        Called after each file.

    Returns
    -------
    Guess
        Nothing is written before its `write`.

    Raises
    ------
    CampaignError
        If there is no such folder, or no recording in it.

    Examples
    --------
    >>> import tempfile
    >>> from fourpole.virtual import simulate_campaign
    >>> with tempfile.TemporaryDirectory() as place:
    ...     made = simulate_campaign(place, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True)
    ...     guess = guess_campaign(made.folder)
    >>> [(row.name, row.kind, row.values.get("frequency")) for row in guess.rows]
    [('D1', 'dynamic', 14.0), ('D2', 'dynamic', 14.0), ('S1', 'static', None), ('S2', 'static', None)]
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CampaignError(f"{units.shown(folder, 200)[1:-1]}: there is no such folder")
    gathered = gather(folder, progress)
    if not gathered.seen:
        why = "".join(f"; {name} {reason}" for name, reason in gathered.left_out[:3])
        raise CampaignError(f"{units.shown(folder, 200)[1:-1]}: holds no recording that can be read{why}")
    return _Together(folder, gathered).guess()


class _Together:
    """The steps from what was seen to a guess; each adds its doubts."""

    def __init__(self, folder: Path, gathered: FolderContents) -> None:
        self.folder, self.gathered = folder, gathered
        self.seen = gathered.seen
        self.doubts: list[Doubt] = []
        self.of_row: list[list[str]] = [[] for _ in self.seen]
        self.names = _test_names(self.seen)
        self.pending: dict[tuple[str, str], list[tuple[int, str]]] = {}

    def guess(self) -> Guess:
        kinds = [self._kind(index) for index in range(len(self.seen))]
        self.kinds = kinds
        self.names = _test_names(self.seen, kinds)
        entries = [
            Entry(kind, one.looked.frequency if one.looked else float("nan"), one.name, one.header, one.folder)
            for kind, one in zip(kinds, self.seen, strict=True)
        ]
        told = tell(entries)
        for index, one in enumerate(told):
            self._frequency(index, one)
            self._only_dynamic(index, one)
        rig = self._rig(told)
        roles = self._roles()
        clock = self._clock()
        self._condition_doubts(told)
        self._files()
        rows = tuple(
            Row(
                name,
                one.file,
                kind,
                "" if kind == "calibration" else cells.tyre,
                _kept(cells.values),
                cells.repeat,
                tuple(dict.fromkeys(doubts)),
            )
            for name, one, kind, cells, doubts in zip(self.names, self.seen, kinds, told, self.of_row, strict=True)
        )
        return Guess(
            folder=self.folder,
            title=self.folder.resolve().name,
            rows=rows,
            roles=roles,
            clock=clock,
            reference=self._reference(),
            rig=rig,
            constructions=_constructions(told),
            doubts=tuple(self.doubts),
            left_out=tuple(self.gathered.left_out),
        )

    # --- kinds ---------------------------------------------------------------------------------------------------

    def _kind(self, index: int) -> str:
        one = self.seen[index]
        shows = one.looked.kind if one.looked is not None else ""
        said = next((kind_word(token.text) for token in (*one.name, *one.header) if token.what == "kind"), "")
        if one.problem:
            self._row(index, "files", f"could not be read: {one.problem}")
        if said == "calibration" and shows != "static":
            return "calibration"
        if not shows:
            if not one.problem:
                self._row(index, "kind", "its signals show no steady sinusoid and no slow curve")
            return said or "dynamic"
        if said and said != shows:
            what = (
                "a slow curve"
                if shows == "static"
                else f"a steady sinusoid of {one.looked.frequency:.4g} Hz"
                if one.looked
                else ""
            )
            self._row(index, "kind", f"its name says {said}, its signals show {what}: taken as {shows}")
        return shows

    def _row(self, index: int, about: str, text: str) -> None:
        """A doubt of one test, gathered with those of the same kind."""
        self.of_row[index].append(text)
        self.pending.setdefault((about, ""), []).append((index, text))

    # --- conditions ----------------------------------------------------------------------------------------------

    def _frequency(self, index: int, told: Told) -> None:
        one = self.seen[index]
        if self.kinds[index] == "static":
            told.values.pop("frequency", None)
            return
        found = one.looked.frequency if one.looked is not None and one.looked.kind == "dynamic" else float("nan")
        stated = told.values.get("frequency")
        if not np.isfinite(found):
            return
        if stated is None:
            told.values["frequency"] = float(f"{found:.4g}")
        elif abs(stated - found) > _SAME_FREQUENCY * found:
            told.values["frequency"] = float(f"{found:.4g}")
            if one.rate is None or abs(stated - one.rate) > 1e-3 * one.rate:
                told.doubts.append(
                    ("frequency", f"{stated:g} Hz is stated, the recording shows {found:.4g} Hz, which is taken")
                )

    def _only_dynamic(self, index: int, told: Told) -> None:
        """A static test needs no preload, added mass or amplitude where dynamic ones are there."""
        if self.kinds[index] == "static" and "dynamic" in self.kinds:
            for what in ("preload", "added_mass", "amplitude"):
                told.values.pop(what, None)
            told.doubts = [doubt for doubt in told.doubts if doubt[0] not in ("preload", "added_mass", "frequency")]

    def _condition_doubts(self, told: Sequence[Told]) -> None:
        for index, one in enumerate(told):
            for about, text in one.doubts:
                self._row(index, about, text)
        for what, kinds, gives in _WANTED:
            lacking = [i for i, one in enumerate(told) if self.kinds[i] in kinds and what not in one.values]
            for index in lacking:
                self.of_row[index].append(f"{what} is not known")
            if lacking:
                every = "every" if len(lacking) == sum(kind in kinds for kind in self.kinds) else f"{len(lacking)}"
                tests = tuple(self.names[index] for index in lacking)
                unit = {"pressure": "bar", "preload": "N", "added_mass": "kg"}[what]
                label = f"'{what} [{unit}]'"
                self.doubts.append(
                    Doubt(
                        what,
                        f"{what}: not known of {_counted(every, kinds)}; {gives}",
                        f"fill in the column {label} of tests.csv",
                        tests,
                    )
                )
        for (about, _), several in self.pending.items():
            examples = list(dict.fromkeys(text for _, text in several))
            more = f" (and {len(examples) - 2} more like it)" if len(examples) > 2 else ""
            tests = tuple(dict.fromkeys(self.names[index] for index, _ in several))
            count = f"{len(tests)} tests" if len(tests) > 1 else f"test {tests[0]}"
            self.doubts.append(
                Doubt(
                    about,
                    f"{about}, {count}: {'; '.join(examples[:2])}{more}",
                    _REMEDIES.get(about, "check the column of that name in tests.csv"),
                    tests,
                )
            )

    # --- channels ------------------------------------------------------------------------------------------------

    def _roles(self) -> dict[str, Role]:
        static = self._voted(("static",), static_roles)
        dynamic = self._voted(("dynamic", "calibration"), dynamic_roles)
        dynamic = self._scaled(dynamic, static)
        roles = {**dynamic, **static}
        for role, one in roles.items():
            for doubt in one.doubts:
                self.doubts.append(
                    Doubt(
                        role,
                        f"{role}, column {shown(one.column, 40)}: {doubt}",
                        f"correct {role} in [channels] of campaign.toml if need be",
                    )
                )
        for kind, needed in (("dynamic", ("force_in", "motion_in", "motion_out")), ("static", ("load", "deflection"))):
            for role in needed:
                if kind in self.kinds and role not in roles:
                    columns = self._columns(kind)
                    self.doubts.append(
                        Doubt(
                            role,
                            f"{role}: no column is understood as it among {columns}; {_WITHOUT[role]}",
                            f"state {role} in [channels] of campaign.toml",
                        )
                    )
        return roles

    def _columns(self, kind: str) -> str:
        one = next(one for one, own in zip(self.seen, self.kinds, strict=True) if own == kind)
        return ", ".join(shown(column.name, 30) for column in one.columns[:10])

    def _voted(
        self, kinds: tuple[str, ...], roles_of: Callable[[Sequence[Column], Sequence[SignalShape]], dict[str, Role]]
    ) -> dict[str, Role]:
        """Roles by the columns that most recordings have; others are told."""
        groups: dict[tuple[tuple[str, str | None], ...], list[int]] = {}
        for index, one in enumerate(self.seen):
            if self.kinds[index] in kinds:
                groups.setdefault(tuple((column.name, column.unit) for column in one.columns), []).append(index)
        found = []
        for members in groups.values():
            looks = [look for index in members if (look := self.seen[index].looked) is not None]
            found.append((members, roles_of(self.seen[members[0]].columns, looks)))
        if not found:
            return {}
        best = max(found, key=lambda one: (len(one[1]) >= len(kinds), len(one[0])))[1]
        for members, roles in found:
            for role, mine in best.items():
                theirs = roles.get(role)
                if theirs is None or (theirs.column.casefold(), theirs.unit) != (mine.column.casefold(), mine.unit):
                    has = "no such column" if theirs is None else f"{shown(theirs.column, 30)} [{theirs.unit}]"
                    for index in members:
                        self._row(
                            index,
                            "channels",
                            f"{role} is {shown(mine.column, 30)} [{mine.unit}] in most recordings, here it has {has}",
                        )
        return best

    def _scaled(self, dynamic: dict[str, Role], static: dict[str, Role]) -> dict[str, Role]:
        """Hold the dynamic stiffness against the static one: a unit of F1 that nobody stated is the one that fits."""
        looks = {
            kind: [one.looked for one, own in zip(self.seen, self.kinds, strict=True) if own == kind and one.looked]
            for kind in ("dynamic", "static")
        }
        if any(role.unit is None for role in (*dynamic.values(), *static.values())):
            return dynamic
        ratio = force_scale(dynamic, looks["dynamic"], static, looks["static"])
        if not np.isfinite(ratio):
            return dynamic
        force = dynamic["force_in"]
        if _LIKELY[0] < ratio < _LIKELY[1]:
            fits = f", and it fits: K* is {ratio:.2g} times the static stiffness"
            doubts = tuple(doubt + fits if "stated nowhere" in doubt else doubt for doubt in force.doubts)
            return {**dynamic, "force_in": replace(force, doubts=doubts)}
        other = {"N": ("kN", 1e3), "kN": ("N", 1e-3)}.get(force.unit or "", ("", 1.0))
        unstated = any("stated nowhere" in doubt for doubt in force.doubts)
        if unstated and _LIKELY[0] < ratio * other[1] < _LIKELY[1]:
            doubt = (
                f"its unit is stated nowhere: taken as {other[0]}, with which K* is {ratio * other[1]:.2g} "
                f"times the static stiffness"
            )
            return {**dynamic, "force_in": replace(force, unit=other[0], doubts=(doubt,))}
        doubt = f"with these units K* is {ratio:.2g} times the static stiffness: check the units of all channels"
        return {**dynamic, "force_in": force.doubted(doubt)}

    def _clock(self) -> tuple[str, str] | None:
        """Column of the time; None where each recording knows its times by itself, or nothing says them."""
        tested = [index for index, kind in enumerate(self.kinds) if kind != "static"]
        clocks = Counter((self.seen[at].clock, self.seen[at].clock_unit) for at in tested if self.seen[at].clock)
        if not clocks:
            if any(not self.seen[at].timed for at in tested):
                text = "time: no column and no sample rate is stated in the recordings"
                self.doubts.append(Doubt("time", text, "state sample_rate in [channels] of campaign.toml"))
            return None
        (column, unit), _ = clocks.most_common(1)[0]
        for at in tested:
            here = self.seen[at].clock or "not there"
            if self.seen[at].text and here.casefold() != (column or "").casefold():
                text = f"the time is {shown(column, 30)} in most recordings, here it is {shown(here, 30)}"
                self._row(at, "channels", text)
        return column or "t", unit

    def _reference(self) -> tuple[str, str, int] | None:
        """A tacho that all dynamic tests have, whose pulses go with their frequencies."""
        tested = [one for one, kind in zip(self.seen, self.kinds, strict=True) if kind != "static"]
        shared = [{column.name: column for column in one.columns if column.quantity == "reference"} for one in tested]
        for name, column in shared[0].items() if shared else ():
            counts = [one.looked.pulses.get(name, 0.0) for one in tested if one.looked is not None]
            unit = column.unit if column.unit in ("V", "mV") else "V" if column.unit in (None, "1") else ""
            pulses = round(float(np.median(counts))) if counts else 0
            if not unit or not pulses or not all(name in own for own in shared):
                continue
            if all(abs(count / pulses - 1) < 0.05 for count in counts):
                text = (
                    f"reference, column {shown(name, 40)}: {pulses} pulse{'s' if pulses > 1 else ''} per "
                    f"cycle of the excitation were counted"
                )
                self.doubts.append(
                    Doubt("reference", text, "correct reference in [channels] of campaign.toml, or remove it")
                )
                return name, unit, pulses
        return None

    # --- the rest ------------------------------------------------------------------------------------------------

    def _rig(self, told: Sequence[Told]) -> dict[str, float]:
        stated: dict[str, set[float]] = {}
        for one in told:
            for what in _RIG:
                if what in one.values:
                    stated.setdefault(what, set()).add(one.values.pop(what))
        for token in self.gathered.notes:
            if token.what in _RIG:
                stated.setdefault(token.what, set()).add(token.value)
        rig = {what: next(iter(values)) for what, values in stated.items() if len(values) == 1}
        for what, values in stated.items():
            if len(values) > 1:
                listed = ", ".join(f"{value:g}" for value in sorted(values)[:5])
                self.doubts.append(
                    Doubt(
                        "rig",
                        f"{what}: stated as {listed}, so none is taken",
                        "state the right one in [rig] of campaign.toml",
                    )
                )
        if "dynamic" in self.kinds and not {"moving_mass", "preload_stiffness"} <= rig.keys():
            self.doubts.append(
                Doubt(
                    "rig",
                    "rig: its moving mass and preload spring are stated nowhere; with them the joint route "
                    "also finds their errors and "
                    "those of the sensors, and predicts the transmissibility. Without: K* by the relative "
                    "route from F1, V1 and V2",
                    "fill in [rig] in campaign.toml and remove its # signs",
                )
            )
        return rig

    def _files(self) -> None:
        for count, (name, why) in enumerate(self.gathered.left_out):
            if count == 3:
                self.doubts.append(
                    Doubt(
                        "files", f"{len(self.gathered.left_out) - 3} more files were left out", "see fourpole info FILE"
                    )
                )
                return
            self.doubts.append(
                Doubt("files", f"{shown(name, 100)[1:-1]} was left out: {why}", "export it again if it is a recording")
            )


_WANTED = (
    ("pressure", ("static", "dynamic"), "all tests of a tyre count as at one pressure"),
    ("preload", ("dynamic",), "K1 cannot be read off the static curve, so there is no K2 and C"),
    ("added_mass", ("calibration",), "a calibration is of no use without its mass"),
)
_REMEDIES = {
    "kind": "check the column 'kind' of tests.csv",
    "tyre": "fill in the column 'tyre' of tests.csv, and name each tyre under [tyres] in campaign.toml",
    "channels": "give these recordings the same columns as the others; one campaign has one [channels]",
    "files": "see fourpole info FILE; export it again",
    "pressure": "check the column 'pressure [bar]' of tests.csv",
    "preload": "check the column 'preload [N]' of tests.csv",
    "frequency": "check the column 'frequency [Hz]' of tests.csv",
    "added_mass": "check the column 'added_mass [kg]' of tests.csv",
    "temperature": "check the column 'temperature [degC]' of tests.csv",
}
_WITHOUT = {
    "force_in": "without it only the transmissibility route remains, which needs the rig",
    "motion_in": "without it dynamic tests cannot be analysed",
    "motion_out": "without it only the mobility route remains, which needs the rig",
    "load": "without it static tests cannot be analysed",
    "deflection": "without it static tests cannot be analysed",
}


def _counted(every: str, kinds: tuple[str, ...]) -> str:
    what = "test" if len(kinds) > 1 else f"{kinds[0]} test"
    return f"{every} {what}" if every in ("every", "1") else f"{every} {what}s"


def _kept(values: dict[str, float]) -> dict[str, float]:
    """Conditions that tests.csv has; an added mass of nothing is none."""
    return {what: value for what, value in values.items() if what not in _RIG}


def _test_names(seen: Sequence[Seen], kinds: Sequence[str] = ()) -> list[str]:
    """Short names of the recordings, or S1, D1, C1 where their names are long, strange or not their own."""
    names = []
    for one in seen:
        file, _, group = one.file.partition("#")
        stem = without_ending(file.rpartition("/")[2])
        names.append(group.rpartition("/")[2] if group else stem)
    if len({name.casefold() for name in names}) == len(names) and all(_NAMES_LIKE.fullmatch(name) for name in names):
        return names
    counts: Counter[str] = Counter()
    numbered = []
    for kind in kinds or [""] * len(names):
        letter = {"static": "S", "calibration": "C"}.get(kind, "D")
        counts[letter] += 1
        numbered.append(f"{letter}{counts[letter]}")
    return numbered


def _constructions(told: Sequence[Told]) -> dict[str, str]:
    found: dict[str, str] = {}
    for one in told:
        if one.tyre:
            known = next(
                (says for word, says in CONSTRUCTIONS if word in re.sub(r"[\W_]", "", one.tyre.casefold())), ""
            )
            found[one.tyre] = found.get(one.tyre) or one.construction or known
    return found
