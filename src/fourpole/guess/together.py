"""A guessed campaign from names, headers, notes and signals of a folder: tests, channels, rig, and the doubts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from fourpole import quantities as q
from fourpole import units
from fourpole.core.condition import Axis
from fourpole.errors import CampaignError
from fourpole.guess.conditions import constructions_of, read_conditions
from fourpole.guess.gather import FolderContents, gather
from fourpole.guess.masses import by_mass, rig_doubt, shows_force
from fourpole.guess.names import CONDITIONS, DYNAMIC_KINDS, MOVING_KINDS, Entry, RecordingConditions, Token, kind_word
from fourpole.guess.pattern import named_by, read_pattern, test_names
from fourpole.guess.roles import (
    channel_scale,
    checked_force,
    drive_role,
    dynamic_roles,
    force_scale,
    motion_share,
    static_roles,
)
from fourpole.guess.signals import SignalShape
from fourpole.guess.write import RIG_VALUES, WORDS, Doubt, GuessedCampaign, Row
from fourpole.units import shown
from fourpole.words import first_of
from fourpole.words.heads import Column, Role

#: Relative difference from which a stated frequency is another than that of the recording.
_SAME_FREQUENCY = 0.05
#: Names of recordings that are listed in a doubt.
_MOST_NAMED = 20
#: V2 over V1 below which the far side may be fixed [1].
_STILL = 0.03
#: Relative difference of means of F1 up to which they are of one preload [1].
_ONE_LOAD = 0.02
_TURNING = ("reference", "drive")
#: Conditions that tests need: the kinds of test, and what follows where a condition is not known.
_WANTED = (
    (q.PRESSURE, ("static", *DYNAMIC_KINDS), "all tests of a specimen count as at one pressure"),
    (q.PRELOAD, DYNAMIC_KINDS, "K1 cannot be read off the static curve, so there is no K2 and C"),
    (q.ADDED_MASS, ("calibration",), "a calibration is of no use without its mass"),
)
#: Remedy of a doubt by its subject.
_REMEDIES = WORDS["remedies"] | {one.key: f"check the column '{one.stated_head}' of tests.csv" for one in CONDITIONS}


def guess_campaign(
    folder: str | Path,
    *,
    patterns: Sequence[str] = (),
    rig: Mapping[str, float] | None = None,
    below: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> GuessedCampaign:
    """Guess a campaign from a folder of recordings in any format.

    Parameters
    ----------
    folder : path
        Recordings, in it or below it.
    patterns : sequence of str
        Patterns of the names of recordings, such as "{specimen}_{pressure}bar_{frequency}Hz". The first that matches a
        name says what it states, and nothing is guessed from names. Without a pattern the names are interpreted.
    rig : mapping of str to float, optional
        Values of the rig that are known, in SI, by their keys, as moving_mass.
    below : bool
        Whether the moving mass is below the specimen, which words as "lower" in names of channels then mean.
    progress : callable (done, total)
        Called after each file.

    Returns
    -------
    GuessedCampaign
        Nothing is written before its `write`.

    Raises
    ------
    CampaignError
        If there is no such folder, or no recording in it; if a pattern has an unknown field, or matches no name.

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
    read = [read_pattern(pattern) for pattern in patterns]
    folder = Path(folder)
    if not folder.is_dir():
        raise CampaignError(f"{units.shown(folder, 200)[1:-1]}: there is no such folder")
    gathered = gather(folder, progress)
    if not gathered.recordings:
        why = "".join(f"; {name} {reason}" for name, reason in gathered.left_out[:3])
        raise CampaignError(f"{units.shown(folder, 200)[1:-1]}: holds no recording that can be read{why}")
    unmatched = named_by(read, gathered) if read else []
    together = _Together(folder, gathered, unmatched)
    together.stated, together.below = rig or {}, below
    return together.guess()


def guess_more(folder: Path, known: FolderContents, more: FolderContents) -> list[Row]:
    """The rows of tests.csv of further recordings of a folder, guessed together with those that are known."""
    together = FolderContents([*known.recordings, *more.recordings], notes=[*known.notes, *more.notes])
    files = {one.file for one in more.recordings}
    return [row for row in _Together(folder, together).guess().rows if row.file in files]


class _Together:
    """The steps from the contents of a folder to a guess; each step adds its doubts."""

    def __init__(self, folder: Path, gathered: FolderContents, unmatched: Sequence[int] = ()) -> None:
        self.folder, self.gathered = folder, gathered
        self.stated: Mapping[str, float] = {}
        self.below = False
        self.recordings = gathered.recordings
        self.doubts: list[Doubt] = []
        #: Doubts on single tests, by subject: index of the test and text.
        self.pending: dict[str, list[tuple[int, str]]] = {}
        self.of_row: list[list[tuple[str, str]]] = [[] for _ in self.recordings]
        self.kinds = [self._kind(index) for index in range(len(self.recordings))]
        self.names = test_names(self.recordings, self.kinds)
        if unmatched:
            listed = first_of([shown(self.recordings[index].file, 80) for index in unmatched], _MOST_NAMED)
            for index in unmatched:
                self.of_row[index].append(("", "its name does not match the pattern, so nothing is taken from it"))
            text = f"{len(unmatched)} names do not match the pattern, so nothing is taken from them: {listed}"
            self._doubt("names", text, "fill in their rows of tests.csv, or add a further --pattern", unmatched)

    def guess(self) -> GuessedCampaign:
        roles = self._roles()
        loads = self._mean_loads(roles)
        entries = [
            Entry(kind, one.frequency, one.name, one.header, one.folder, loads.get(index, ()))
            for index, (kind, one) in enumerate(zip(self.kinds, self.recordings, strict=True))
        ]
        conditions = read_conditions(entries, self.names)
        for index, condition in enumerate(conditions):
            self._frequency(index, condition)
            self._only_dynamic(index, condition)
        rig = self._rig(conditions)
        blocked = self._far_side(roles, rig)
        self._lacking(roles, rig, blocked=blocked)
        clock = self._clock()
        self._condition_doubts(conditions)
        self._files()
        return GuessedCampaign(
            folder=self.folder,
            title=self.folder.resolve().name,
            rows=tuple(self._test(index, condition) for index, condition in enumerate(conditions)),
            roles=roles,
            clock=clock,
            reference=self._reference(),
            rig=rig,
            blocked=blocked,
            constructions=constructions_of(conditions),
            doubts=tuple(self.doubts),
            left_out=tuple(self.gathered.left_out),
        )

    def _test(self, index: int, one: RecordingConditions) -> Row:
        """The row of tests.csv of one recording."""
        kind, doubts, recording = self.kinds[index], tuple(dict.fromkeys(self.of_row[index])), self.recordings[index]
        of = (recording.file, kind, "" if kind == "calibration" else one.tyre, one.values, one.repeat)
        return Row(self.names[index], *of, doubts, one.band, recording.window, recording.segment)

    def _doubt(self, about: str, text: str, remedy: str = "", tests: Sequence[int] = ()) -> None:
        """Add a doubt on the campaign, or on the tests of some indices."""
        names = tuple(dict.fromkeys(self.names[index] for index in tests))
        remedy = remedy or _REMEDIES.get(about, "check the column of that name in tests.csv")
        self.doubts.append(Doubt(about, text, remedy, names))

    def _row(self, index: int, about: str, text: str) -> None:
        """Add a doubt on one test; `_condition_doubts` joins those on the same subject."""
        self.of_row[index].append((about, text))
        self.pending.setdefault(about, []).append((index, text))

    def _of_kind(self, *kinds: str) -> list[int]:
        """Indices of the tests of some kinds."""
        return [index for index, kind in enumerate(self.kinds) if kind in kinds]

    # --- kinds ---------------------------------------------------------------------------------------------------

    def _kind(self, index: int) -> str:
        """The kind of a test by its signals, else by its name or header, else "dynamic"."""
        one = self.recordings[index]
        shows = one.shape.kind if one.shape is not None else ""
        named = next((kind_word(token.text) for token in (*one.name, *one.header) if token.what == "kind"), "")
        if one.problem:
            self._row(index, "files", f"could not be read: {one.problem}")
        if named == "calibration" and shows != "static":
            return "calibration"
        if not shows:
            if not one.problem:
                self._row(index, "kind", "its signals show no steady sinusoid and no slow curve")
            return named or "dynamic"
        if named and named != shows:
            text = f"its name says {named}, its signals show {self._shown_kind(index)}: taken as {shows}"
            self._row(index, "kind", text)
        elif not named and shows in ("random", "sweep"):
            self._row(index, "kind", f"its signals show {self._shown_kind(index)}, which its name does not say")
        return shows

    def _shown_kind(self, index: int) -> str:
        """What the signals of a recording show, in words."""
        shape = self.recordings[index].shape
        if shape is None or shape.kind == "static":
            return "a slow curve"
        if shape.band is None:
            return f"a steady sinusoid of {shape.frequency:.4g} Hz"
        what = "random excitation" if shape.kind == "random" else "a sweep"
        return f"{what} from {shape.band[0]:g} to {shape.band[1]:g} Hz"

    # --- conditions ----------------------------------------------------------------------------------------------

    def _frequency(self, index: int, conditions: RecordingConditions) -> None:
        """Set the frequency of a dynamic test; that of its signals has priority over the stated one."""
        one = self.recordings[index]
        if self.kinds[index] not in ("dynamic", "calibration"):
            conditions.forget("frequency")
            self._band(index, conditions)
            return
        conditions.band = None
        if one.shape is None or one.shape.kind != "dynamic" or not np.isfinite(one.frequency):
            return
        found, stated = one.frequency, conditions.values.get("frequency")
        if stated is not None and abs(stated - found) <= _SAME_FREQUENCY * found:
            return
        conditions.values["frequency"] = float(f"{found:.4g}")
        if stated is not None and (one.rate is None or abs(stated - one.rate) > 1e-3 * one.rate):
            text = f"{stated:g} Hz is stated, the recording shows {found:.4g} Hz, which is taken"
            conditions.doubt("frequency", text)

    def _band(self, index: int, conditions: RecordingConditions) -> None:
        """Set the band of a random recording or a sweep: the stated one, else that of its signals."""
        stated, shape = conditions.band, self.recordings[index].shape
        found = None if shape is None else shape.band
        conditions.band = None if self.kinds[index] == "static" else stated or found
        if conditions.band is None or found is None:
            return
        if stated is None:
            conditions.doubt("frequency", f"the band from {found[0]:g} to {found[1]:g} Hz is that of its spectrum")
        elif not (0.5 * found[0] <= stated[0] <= 2 * found[0] and 0.5 * found[1] <= stated[1] <= 2 * found[1]):
            text = f"{stated[0]:g} to {stated[1]:g} Hz is stated, its spectrum shows {found[0]:g} to {found[1]:g} Hz"
            conditions.doubt("frequency", text)

    def _mean_loads(self, roles: dict[str, Role]) -> dict[int, tuple[Token, ...]]:
        """The mean of F1 of each recording as its preload, if it is larger than the amplitude; all may be negative.

        Means that differ by less than 2 % are of one preload, their median.
        """
        role = roles.get("force_in")
        if role is None or role.unit is None:
            return {}
        scale = channel_scale(role)
        means: dict[int, float] = {}
        for index in self._of_kind(*DYNAMIC_KINDS):
            shape = self.recordings[index].shape
            if shape is not None and role.column in shape.means and np.prod(shape.ranges[role.column]) > 0:
                means[index] = scale * shape.means[role.column]
        sign = -1.0 if means and max(means.values()) < 0 else 1.0
        means = {index: sign * mean for index, mean in means.items() if sign * mean > 0}
        below = "" if sign > 0 else ", negative in the files: as compression"
        found: dict[int, tuple[Token, ...]] = {}
        axis = Axis("preload", relative=_ONE_LOAD)
        groups = axis.groups(means.values()) if means else np.zeros(0, int)
        for group in np.unique(groups):
            members = [index for index, of in zip(means, groups, strict=True) if of == group]
            load = float(f"{np.median([means[index] for index in members]):.3g}")
            text = f"the mean of F1 is taken: {load:g} N{below}; so it is if the force cell shows 0 N without a load"
            found |= dict.fromkeys(members, (Token("preload", "mean of F1", load, doubt=text),))
        return found

    def _only_dynamic(self, index: int, conditions: RecordingConditions) -> None:
        """Remove from a static test the conditions of dynamic tests, if the folder has dynamic tests."""
        if self.kinds[index] == "static" and set(DYNAMIC_KINDS) & set(self.kinds):
            conditions.forget("preload", "added_mass", "amplitude")

    def _condition_doubts(self, conditions: Sequence[RecordingConditions]) -> None:
        """Add doubts on conditions that are not known, then those on single tests, joined by subject."""
        for index, one in enumerate(conditions):
            for about, text in one.doubts:
                self._row(index, about, text)
        for quantity, kinds, follows in _WANTED:
            what, tests = quantity.key, self._of_kind(*kinds)
            lacking = [index for index in tests if what not in conditions[index].values]
            for index in lacking:
                self.of_row[index].append((what, "not known"))
            if lacking:
                many = "every" if len(lacking) == len(tests) else str(len(lacking))
                text = f"{what}: not known of {_counted(many, kinds)}; {follows}"
                self._doubt(what, text, f"fill in the column '{quantity.stated_head}' of tests.csv", lacking)
        for about, several in self.pending.items():
            indices = list(dict.fromkeys(index for index, _ in several))
            examples = list(dict.fromkeys(text for _, text in several))
            more = f" (and {len(examples) - 2} more like it)" if len(examples) > 2 else ""
            count = f"{len(indices)} tests" if len(indices) > 1 else f"test {self.names[indices[0]]}"
            self._doubt(about, f"{about}, {count}: {'; '.join(examples[:2])}{more}", tests=indices)

    # --- channels ------------------------------------------------------------------------------------------------

    def _roles(self) -> dict[str, Role]:
        """The column, unit and sign of each role; doubts on them are added."""
        static = self._voted(("static",), static_roles)
        dynamic = self._scaled(self._voted(MOVING_KINDS, dynamic_roles), static)
        moving = self._of_kind(*MOVING_KINDS)
        columns = self.recordings[moving[0]].columns if moving else ()
        dynamic = by_mass(dynamic, self._shapes(moving), columns, below=self.below)
        roles = {**dynamic, **static}
        spread = self._of_kind("random", "sweep")
        if drive := drive_role([self.recordings[index].columns for index in spread], self._shapes(spread)):
            roles["drive"] = drive
        for role, one in roles.items():
            for doubt in one.doubts:
                text = f"{role}, column {shown(one.column, 40)}: {doubt}"
                self._doubt(role, text, f"correct {role} in [channels] of campaign.toml if need be")
        return roles

    def _far_side(self, roles: dict[str, Role], rig: dict[str, float]) -> bool:
        """Whether the far side of the specimen is taken as fixed; asked where V2 is missing or far below V1."""
        near, far = roles.get("motion_in"), roles.get("motion_out")
        tested = self._shapes(self._of_kind(*DYNAMIC_KINDS))
        if near is None or not tested or shows_force(roles):
            return False
        if far is None and near.quantity == "displacement" and not rig:
            self._doubt(
                "far side",
                "far side: no V2 is recorded and V1 is a displacement: the far side of the specimen is taken as fixed, "
                "as on an elastomer bench",
                "if it moves, state moving_mass and preload_stiffness in [rig] of campaign.toml in place of output",
            )
            return True
        why = "no V2 is recorded" if far is None else ""
        if far is not None and (share := motion_share(near, far, tested)) < _STILL:
            why = f"V2 is {100 * share:.2g} % of V1"
        if why:
            self._doubt(
                "far side",
                f"far side: {why}; is the far side of the specimen fixed, as on an elastomer bench",
                'if so, state [rig] with output = "blocked" in campaign.toml; K* then needs no mass and no spring',
            )
        return False

    def _lacking(self, roles: dict[str, Role], rig: dict[str, float], *, blocked: bool) -> None:
        """Add doubts on channels and values of the rig that the tests need and that are not there."""
        for kinds, needed in ((DYNAMIC_KINDS, WORDS["needed"]["dynamic"]), (("static",), WORDS["needed"]["static"])):
            first = next(iter(self._of_kind(*kinds)), None)
            for role, follows in needed.items():
                spared = (blocked and role == "motion_out") or (shows_force(roles) and role == "force_in")
                if first is not None and role not in roles and not spared:
                    columns = ", ".join(shown(column.name, 30) for column in self.recordings[first].columns[:10])
                    text = f"{role}: no column is understood as it among {columns}; {follows}"
                    self._doubt(role, text, f"state {role} in [channels] of campaign.toml")
        if not blocked and set(DYNAMIC_KINDS) & set(self.kinds) and (doubt := rig_doubt(roles, rig)):
            self._doubt("rig", *doubt)

    def _voted(
        self, kinds: tuple[str, ...], roles_of: Callable[[Sequence[Column], Sequence[SignalShape]], dict[str, Role]]
    ) -> dict[str, Role]:
        """Roles by the columns that most recordings have, with a doubt on each recording that has others."""
        groups: dict[tuple[tuple[str, str | None], ...], list[int]] = {}
        for index in self._of_kind(*kinds):
            key = tuple((column.name, column.unit) for column in self.recordings[index].columns)
            groups.setdefault(key, []).append(index)
        found = [
            (members, roles_of(self.recordings[members[0]].columns, self._shapes(members)))
            for members in groups.values()
        ]
        best = max(found, key=lambda one: (len(one[1]) >= 2, len(one[0])), default=([], {}))[1]
        for members, roles in found:
            for role, most in best.items():
                here = roles.get(role)
                if here is None or (here.column.casefold(), here.unit) != (most.column.casefold(), most.unit):
                    has = "no such column" if here is None else f"{shown(here.column, 30)} [{here.unit}]"
                    text = f"{role} is {shown(most.column, 30)} [{most.unit}] in most recordings, here it has {has}"
                    for index in members:
                        self._row(index, "channels", text)
        return best

    def _shapes(self, indices: Sequence[int]) -> list[SignalShape]:
        """Shapes of the signals of some tests; a test whose samples could not be read has none."""
        return [shape for index in indices if (shape := self.recordings[index].shape) is not None]

    def _scaled(self, dynamic: dict[str, Role], static: dict[str, Role]) -> dict[str, Role]:
        """Dynamic roles; an unstated unit of F1 follows from the ratio of |K*| to the static stiffness."""
        if any(role.unit is None for role in (*dynamic.values(), *static.values())):
            return dynamic
        shapes = {kind: self._shapes(self._of_kind(kind)) for kind in ("dynamic", "static")}
        ratio = force_scale(dynamic, shapes["dynamic"], static, shapes["static"])
        if not np.isfinite(ratio):
            return dynamic
        return {**dynamic, "force_in": checked_force(dynamic["force_in"], ratio)}

    def _clock(self) -> tuple[str, str] | None:
        """Column of the time and its unit; None if the recordings state their times, or if no time is found."""
        tested = [self.recordings[index] for index in self._of_kind(*MOVING_KINDS)]
        clocks = Counter((one.clock, one.clock_unit) for one in tested if one.clock is not None)
        if not clocks:
            if not all(one.timed for one in tested):
                self._doubt("time", "time: no column and no sample rate is stated in the recordings")
            return None
        (column, unit), _ = clocks.most_common(1)[0]
        for index in self._of_kind(*MOVING_KINDS):
            here = self.recordings[index].clock or "not there"
            if self.recordings[index].text and here.casefold() != column.casefold():
                text = f"the time is {shown(column, 30)} in most recordings, here it is {shown(here, 30)}"
                self._row(index, "channels", text)
        return column, unit

    def _reference(self) -> tuple[str, str, int] | None:
        """A tacho of all dynamic tests with a constant number of pulses per cycle: column, unit and this number."""
        tested = self._of_kind("dynamic", "calibration")
        columns = [
            {column.name: column for column in self.recordings[index].columns if column.quantity in _TURNING}
            for index in tested
        ]
        for name, column in columns[0].items() if columns else ():
            unit = {"V": "V", "mV": "mV", None: "V", "1": "V"}.get(column.unit)
            pulses = _constant([shape.pulses.get(name, 0.0) for shape in self._shapes(tested)])
            if unit and pulses and all(name in own for own in columns):
                counted = f"{pulses} pulse{'s' if pulses > 1 else ''} per cycle of the excitation were counted"
                self._doubt("reference", f"reference, column {shown(name, 40)}: {counted}")
                return name, unit, pulses
        return None

    # --- rig and files -----------------------------------------------------------------------------------------------

    def _rig(self, conditions: Sequence[RecordingConditions]) -> dict[str, float]:
        """Values of the rig on which names, headers and notes agree, in SI."""
        stated: dict[str, set[float]] = {}
        pairs = [(what, one.values.pop(what)) for one in conditions for what in RIG_VALUES if what in one.values]
        pairs += [(token.what, token.value) for token in self.gathered.notes if token.what in RIG_VALUES]
        for what, value in pairs:
            if what not in self.stated:
                stated.setdefault(what, set()).add(value)
        for what, values in stated.items():
            if len(values) > 1:
                text = f"{what}: stated as {first_of([f'{value:g}' for value in sorted(values)], 5)}, so none is taken"
                self._doubt("rig", text, "state the right one in [rig] of campaign.toml")
        return {**{what: next(iter(one)) for what, one in stated.items() if len(one) == 1}, **self.stated}

    def _files(self) -> None:
        """Add doubts on the files that are no recordings."""
        left_out = self.gathered.left_out
        for name, why in left_out[:3]:
            text = f"{shown(name, 100)[1:-1]} was left out: it {why}"
            self._doubt("files", text, "export it again if it is a recording")
        if len(left_out) > 3:
            self._doubt("files", f"{len(left_out) - 3} more files were left out", "see fourpole info FILE")


def _constant(counts: Sequence[float]) -> int:
    """The whole number from which all counts differ by less than 5 %; 0 if there is none."""
    number = round(float(np.median(counts))) if counts else 0
    return number if number and all(abs(count / number - 1) < 0.05 for count in counts) else 0


def _counted(every: str, kinds: tuple[str, ...]) -> str:
    """The number of tests in words: "every dynamic test", "3 tests"."""
    return f"{every} {'' if len(kinds) > 1 else f'{kinds[0]} '}test{'' if every in ('every', '1') else 's'}"
