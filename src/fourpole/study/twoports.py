"""The four poles of the specimens of a campaign, from its rigid blocks and added masses."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign, condition_numbers, read_campaign
from fourpole.campaign.row import Test, condition_words
from fourpole.core.allpoles import POLES, AllPoles, Setups, all_poles, reciprocal
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.checks import Verdict
from fourpole.core.joint.conditions import group_conditions
from fourpole.core.phasor import CHANNELS
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind
from fourpole.core.specimen import BLOCK, TYRE
from fourpole.core.specimenfit import UNLIKELY, SpecimenFit, fit_specimen
from fourpole.errors import CampaignError
from fourpole.io.folders import is_for_keeping, make_folder
from fourpole.study.cache import Cache
from fourpole.study.identify import setup_of, without_fixtures
from fourpole.study.points import Points, StaticStiffness
from fourpole.study.reduce import jobs_of
from fourpole.study.workers import reduce_tests
from fourpole.words import remark_of

#: Errors of the channels that another mounting or another added mass changes.
_MOUNTED = (Kind.MOUNTING_GAIN, Kind.MOUNTING_PHASE, Kind.REMOUNTING_GAIN, Kind.REMOUNTING_PHASE)
_PARTS = ("Re", "Im")
#: Relative differences of frequency in a group beyond this need a second frequency, for the slopes.
_EQUAL = 1e-4


@dataclass(frozen=True, eq=False)
class TwoPort(ByValue):
    """The four poles of a specimen at one condition.

    Attributes
    ----------
    test : Test
        Its first test, with specimen, rig and condition.
    name : str
        Specimen and condition in words.
    measured : AllPoles
        As measured, with k12 and k21 each by itself.
    poles : AllPoles
        With k12 = k21, if the measured ones do not contradict it; otherwise as measured.
    chance : float [1]
        Chance that the poles of a reciprocal specimen would differ as much as the measured k12 and k21.
    form : SpecimenFit or None
        The massless spring, belt or rod that describes them best; None if they are not reciprocal.
    notes : tuple of str
        Tests and frequencies that were left out, with the reason, and what was assumed.
    """

    test: Test
    name: str
    measured: AllPoles
    poles: AllPoles
    chance: float
    form: SpecimenFit | None
    notes: tuple[str, ...] = ()

    @property
    def reciprocal(self) -> bool:
        """Whether k12 and k21 agree within their uncertainty."""
        return self.chance >= UNLIKELY

    @property
    def form_fits(self) -> bool:
        """Whether the form describes the poles within their uncertainty."""
        return self.form is not None and self.form.chance >= UNLIKELY


def measure_two_ports(
    campaign: Campaign | str | Path,
    *,
    cache: str | Path | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[TwoPort], list[str]]:
    """The four poles of each specimen and condition of a campaign that has rigid blocks and two added masses.

    Parameters
    ----------
    campaign : Campaign or path
    cache : path, optional
        Folder of the phasors of each recording.
    workers : int, optional
        Number of processes that reduce the recordings.
    progress : callable, optional
        Called with the number of reduced recordings and the number of all recordings.

    Returns
    -------
    two_ports : list of TwoPort
    lacks : list of str
        Conditions without four poles, each with what to add.

    Raises
    ------
    CampaignError
        If a channel is missing, the output is blocked, or no condition has what four poles need.
    """
    stated = campaign if isinstance(campaign, Campaign) else read_campaign(campaign)
    for role in CHANNELS:
        if stated.stated.channels.named(role) is None:
            raise CampaignError(f"campaign.toml: [channels] {role} is missing: four poles need F1, V1 and V2")
    tests = [test for test in stated.of_kind("dynamic") if not _is_blocked(stated, test)]
    if not tests:
        raise CampaignError("no dynamic test on a rig whose far side moves: a blocked specimen does not show k22")
    kept = None
    if cache is not None and is_for_keeping(Path(cache), stated.folder):
        kept = Cache(make_folder(cache))
    points = reduce_tests(jobs_of(stated, tests, "joint"), cache=kept, workers=workers, progress=progress)
    count = len(points.tests)
    points = replace(
        points,
        condition=condition_numbers(stated, points.tests),
        stiffness=(StaticStiffness(),) * count,
        strange=np.zeros(count, dtype=bool),
    )
    points = without_fixtures(stated, points)
    condition, sound = points.condition, points.sound & np.isfinite(points.phasors.amplitudes).all(axis=1)
    found: list[TwoPort] = []
    lacks: list[str] = []
    rigs = np.array([test.rig for test in points.tests])
    for rig in dict.fromkeys(rigs.tolist()):
        for number in dict.fromkeys(condition[(rigs == rig) & (condition >= 0)].tolist()):
            rows = np.flatnonzero((rigs == rig) & ((condition == number) | (condition < 0)))
            made = _two_port(stated, points, rows, rows[sound[rows]])
            if isinstance(made, TwoPort):
                found.append(made)
            else:
                lacks.append(made)
    if not found:
        nothing = "no test of a specimen: add tests of kind = dynamic with two added masses"
        raise CampaignError(f"four poles cannot be found. {'. '.join(lacks) or nothing}")
    return found, lacks


def _is_blocked(campaign: Campaign, test: Test) -> bool:
    rig = campaign.stated.all_rigs.get(test.rig)
    return rig is not None and rig.output == "blocked"


def _two_port(campaign: Campaign, points: Points, every: np.ndarray, rows: np.ndarray) -> TwoPort | str:
    """The four poles by rows of one condition and of the blocks, or what is lacking; `every` has rejected rows too."""
    first = next(points.tests[row] for row in every if points.tests[row].kind != "calibration")
    name = condition_words(first, further=[axis.name for axis in campaign.stated.conditions.axes])
    notes = [*_rejected(points, set(every) - set(rows))]
    if not rows.size:
        return "; ".join([f"{name}: no test can be used", *notes])
    known, phasors = setup_of(campaign, first.rig, points, rows)[0], points.phasors.part(rows)
    # Blocks and specimen are one family here; each test has its place in a frequency.
    family = np.zeros(rows.size, dtype=int)
    group = group_conditions(family, phasors.frequency, known["nominal_frequency"], known["recording"])
    rigid = points.condition[rows] < 0
    setups = Setups(rigid, known["added_mass"], known["added_mass_std"], group)
    lacking = {number: lack for number in np.unique(group).tolist() if (lack := setups.part(group == number).lacking())}
    used = ~np.isin(group, list(lacking))
    if not used.any():
        return "; ".join([f"{name}: {setups.lacking() or next(iter(lacking.values()))}", *notes])
    for number, lack in lacking.items():
        notes.append(f"{np.mean(phasors.frequency[group == number]):.4g} Hz is left out: it has {lack}")
    phasors, setups = phasors.part(used), setups.part(used)
    if np.unique(setups.group).size == 1 and np.ptp(phasors.frequency) > _EQUAL * phasors.frequency.max():
        notes.append("the tests differ slightly in frequency, and there is no second frequency to correct for that")
    labels = [np.unique(label.astype(str), return_inverse=True)[1] for label in (known["mounting"][used], setups.mass)]
    every_error = replace(known["channels"], response=None, fixture=None).errors(phasors.omega, labels)
    errors = tuple(error for error in every_error if error.source.kind in _MOUNTED)
    rig = known["rig"] or Rig(blocked=True)
    masses = {key: (getattr(rig, key), rig.std.get(key, 0.0)) for key in ("input_mass", "tyre_mass")}
    notes += [_UNSTATED[key] if not value else _STATED[key].format(value) for key, (value, _) in masses.items()]
    measured = all_poles(
        phasors,
        setups,
        input_mass=masses["input_mass"],
        wheel_mass=masses["tyre_mass"],
        change=known["specimens"].block,
        errors=errors,
    )
    if measured.agreement < UNLIKELY:
        worst, scale = int(np.argmax(measured.misfit / measured.dof)), measured.misfit.sum() / measured.dof.sum()
        measured = replace(measured, noise=measured.noise * scale)
        notes.append(
            f"the tests do not agree within their uncertainty, at {measured.frequency[worst]:.4g} Hz the least: the "
            f"variance of their noise is enlarged {scale:.3g} times. See whether V1/V2 is the same with all blocks (if "
            "not, a block is not rigid or a sensor moved), and whether repeats agree"
        )
    equal, chance = reciprocal(measured)
    share = TYRE if first.tyre in campaign.stated.tyres else BLOCK
    form = fit_specimen(measured, share) if chance >= UNLIKELY else None
    return TwoPort(first, name, measured, equal if form is not None else measured, chance, form, tuple(notes))


_UNSTATED = {
    "input_mass": "no input_mass is stated: a part between force cell and contact would be a mass in k11, and a "
    "negative one in k22",
    "tyre_mass": "no tyre_mass is stated: what was mounted with the specimen at its wheel side is part of k22",
}
_STATED = {
    "input_mass": "the stated input_mass, {:g} kg, is taken off k11",
    "tyre_mass": "the stated tyre_mass, {:g} kg, is taken off k22",
}


def _rejected(points: Points, rows: set[int]) -> Iterator[str]:
    """A note on each row that cannot be used: why it is rejected, or else all that is known of a missing channel."""
    for row in sorted(rows):
        checks = points.checks[row]
        reasons = [remark_of(check) for check in checks if check.verdict is Verdict.REJECTED]
        reasons = reasons or ["F1, V1 or V2 is missing", *filter(None, map(remark_of, checks))]
        yield f"test {points.tests[row].name} is left out: {'; '.join(reasons)}"


def two_port_table(found: list[TwoPort]) -> pl.DataFrame:
    """One row per specimen, condition and frequency: poles, uncertainties, determinant, and the form held against them.

    Poles are in N/m; the determinant of the four-pole is k12/k21 as measured.
    """
    tables = []
    for two_port in found:
        test, form, nothing = two_port.test, two_port.form, np.full((len(two_port.poles.frequency), 4), np.nan)
        states = {quantity.head: test.value(quantity.key) for quantity in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE)}
        columns: dict[str, Any] = {q.TYRE.head: test.tyre, q.RIG.head: test.rig, **states}
        columns |= {q.FREQUENCY.head: two_port.poles.frequency, "k12 = k21": form is not None}
        values, of_form = (
            two_port.poles.stiffness.reshape(-1, 4),
            nothing if form is None else form.poles.reshape(-1, 4),
        )
        for at, pole in enumerate(POLES):
            columns |= _complex_cells(pole, "N/m", values[:, at], two_port.poles.std[:, at])
        measured = two_port.measured
        columns |= _complex_cells("det", "1", measured.determinant, measured.determinant_std)
        columns["form"] = "" if form is None else form.specimen.form.value
        columns["mass of the form [kg]"] = None if form is None else form.specimen.mass
        columns["u(mass of the form) [kg]"] = None if form is None else form.mass_std
        for at, pole in enumerate(POLES):
            columns |= _complex_cells(f"{pole} of the form", "N/m", of_form[:, at])
        tables.append(pl.DataFrame(columns).with_columns(pl.col(pl.Float64).fill_nan(None)))
    return pl.concat(tables, how="vertical_relaxed")


def _complex_cells(name: str, unit: str, values: ComplexArray, std: FloatArray | None = None) -> dict[str, FloatArray]:
    """Columns of complex values, with the standard uncertainties (F, 2) of both parts if there are any."""
    columns = {f"Re {name} [{unit}]": values.real, f"Im {name} [{unit}]": values.imag}
    return (
        columns
        if std is None
        else columns | {f"u({part} {name}) [{unit}]": std[:, at] for at, part in enumerate(_PARTS)}
    )
