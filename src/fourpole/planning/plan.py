"""Before testing: a campaign whose recordings do not exist yet, or a rig and a guessed tyre, becomes a plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.campaign.channels import DEFAULT_GAIN_STD, DEFAULT_PHASE_STD
from fourpole.campaign.folder import Campaign, Test, read_campaign
from fourpole.campaign.schema import DEFAULT_RIG_STD
from fourpole.core.arrays import FloatArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.phasor import CHANNELS
from fourpole.core.plan import Plan, PlannedTests
from fourpole.core.plan.expect import arm_by_k1, planned_phasors, relative_uncertainties
from fourpole.core.rig import Rig
from fourpole.errors import CampaignError, RigError
from fourpole.study.identified import ADDED_MASS_STD, setup_of
from fourpole.study.results import read_results
from fourpole.study.static import StaticStiffness
from fourpole.study.tables import tyre_cells

__all__ = [
    "AS_STATED",
    "CampaignPlan",
    "Guess",
    "RigPlan",
    "Run",
    "bare_plan",
    "plan",
    "plan_campaign",
    "plan_table",
    "with_kg",
]

#: The plan as tests.csv has it, in the column ``plan``.
AS_STATED = "as stated"
_K1_STD = 0.02
_CYCLES = 40.0
#: K1, its standard uncertainty, K2 [N/m], C [N s/m].
_Tyre: TypeAlias = tuple[float, float, float, float]


@dataclass(frozen=True)
class Guess:
    """The tyre as guessed; None where it is not.

    Attributes
    ----------
    k1, k2, c : float [N/m], [N/m], [N s/m]
    k1_std : float [1]
        Relative standard uncertainty that the static tests will leave of K1.
    """

    k1: float | None = None
    k2: float | None = None
    c: float | None = None
    k1_std: float | None = None


@dataclass(frozen=True)
class Run:
    """How each test is run.

    Attributes
    ----------
    noise : float [1]
        Standard uncertainty of Re and of Im of each amplitude over its modulus, after 40 cycles.
    cycles : float [1]
        Recorded in each test; the noise falls with their root.
    eccentricity : float [m]
        Amplitude of the contact's motion.
    """

    noise: float = 1e-4
    cycles: float = _CYCLES
    eccentricity: float = 1e-3

    @property
    def noise_of_test(self) -> float:
        """The noise after all cycles [1]."""
        return float(self.noise * np.sqrt(_CYCLES / self.cycles))


@dataclass(frozen=True)
class RigPlan:
    """The planned tests of one rig; `tests` are the rows of tests.csv that `plan.tests` stands for."""

    name: str
    plan: Plan
    tests: tuple[Test, ...]


@dataclass(frozen=True)
class CampaignPlan:
    """What is planned.

    Attributes
    ----------
    rigs : tuple of RigPlan
        The dynamic tests.
    tests : tuple of Test
        All tests, the static ones too.
    extra_columns : tuple of str
        Columns that pass through.
    notes : tuple of str
        What was assumed, and what would go wrong.
    """

    rigs: tuple[RigPlan, ...]
    tests: tuple[Test, ...]
    extra_columns: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def table(self, masses: Sequence[float] = ()) -> pl.DataFrame:
        """The uncertainties to expect, as `plan_table` gives them."""
        return plan_table(self, masses)


def plan(
    campaign: Campaign | str | Path,
    *,
    k1: float | None = None,
    k2: float | None = None,
    c: float | None = None,
    k1_std: float | None = None,
    noise: float = 1e-4,
    cycles: float = _CYCLES,
    eccentricity: float = 1e-3,
) -> CampaignPlan:
    """Plan a campaign before testing: its tests with the uncertainty to expect of each; no recording is read.

    Parameters
    ----------
    campaign : Campaign or path
        The campaign, or its folder.
    k1, k2, c : float [N/m], [N/m], [N s/m], optional
        The guessed tyre. What is not given comes from tests.csv (K1), or from an earlier analysis of the campaign.
    k1_std : float [1], optional
        Relative standard uncertainty that the static tests will leave of K1; 2 % where nothing states it.
    noise : float [1]
        Standard uncertainty of Re and of Im of each amplitude over its modulus, after 40 cycles.
    cycles : float [1]
        Recorded in each test; the noise falls with their root.
    eccentricity : float [m]
        Amplitude of the contact's motion.

    Returns
    -------
    CampaignPlan
        Its method ``table`` gives a row per route and test.

    Raises
    ------
    CampaignError
        If a test cannot be planned: it has a problem, no frequency, or no guess of its tyre.
    RigError
        If a rig is not stated.

    Examples
    --------
    >>> import tempfile
    >>> from fourpole import simulate_campaign
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = simulate_campaign(folder, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True)
    ...     planned = plan(made.folder, k1=110e3, k2=100e3, c=800.0)
    >>> planned.table()["route"].unique(maintain_order=True).to_list()
    ['mobility', 'relative', 'transmissibility', 'joint']
    """
    stated = campaign if isinstance(campaign, Campaign) else read_campaign(campaign)
    return plan_campaign(stated, Guess(k1, k2, c, k1_std), Run(noise, cycles, eccentricity))


def plan_campaign(campaign: Campaign, guess: Guess, run: Run) -> CampaignPlan:
    """Plan of a campaign; no recording is read.

    Parameters
    ----------
    campaign : Campaign
        As `read_campaign` gives it.
    guess : Guess
        What is not guessed is taken from the row of tests.csv (K1), or from CAMPAIGN/results/dynamic.csv: the
        nearest test of the same tyre.
    run : Run

    Returns
    -------
    CampaignPlan

    Raises
    ------
    CampaignError
        If a test cannot be planned: it has a problem, no frequency, or no guess of its tyre.
    RigError
        If a rig is not stated.
    """
    planned = _to_plan(campaign)
    earlier = _Earlier.of(campaign.folder / "results")
    notes = list(campaign.stated.assumptions())
    if earlier is not None and not _whole(guess):
        notes.append(f"the tyres are guessed from {campaign.folder.name}/results/dynamic.csv")
    rigs = []
    for name in dict.fromkeys(test.rig for test in planned):
        tests = tuple(test for test in planned if test.rig == name)
        rigs.append(_rig_plan(campaign, name, tests, [_tyre(test, guess, earlier) for test in tests], run))
    if _k1_assumed(planned, guess, earlier):
        notes.append("K1: no uncertainty stated, taken as 2 % (--std-k1)")
    return CampaignPlan(tuple(rigs), campaign.tests, campaign.extra_columns, (*notes, *_lift_off(rigs)))


def _to_plan(campaign: Campaign) -> list[Test]:
    """The dynamic tests and calibrations of a campaign; CampaignError where one of them cannot be planned."""
    planned = [test for test in campaign.tests if test.kind != "static"]
    if not planned:
        raise CampaignError("tests.csv: lists no dynamic test, so there is nothing to plan")
    for test in planned:
        if test.problem:
            raise CampaignError(test.problem)
        if test.value("frequency") is None:
            raise CampaignError(f"tests.csv row {test.row}: frequency [Hz] is blank: a plan needs one for each test")
    return planned


def _rig_plan(campaign: Campaign, name: str, tests: tuple[Test, ...], tyres: Sequence[_Tyre], run: Run) -> RigPlan:
    """The plan of the tests of one rig, for the guessed tyre of each test."""
    setup = setup_of(campaign, name, tests, [StaticStiffness(row[0], row[1]) for row in tyres])
    if setup.rig is None:
        raise RigError("campaign.toml: [rig] is missing: a plan needs moving_mass and preload_stiffness")
    force, motion, beyond = (campaign.stated.channels.named(role) is not None for role in CHANNELS)
    if not motion or not (force or beyond):
        raise CampaignError("campaign.toml: [channels] a plan needs motion_in and one of force_in and motion_out")
    k1, k1_std, k2, c = np.array(tyres).T
    drawn = PlannedTests.of(
        np.array([test.values["frequency"] for test in tests]), k1, k2, c, k1_std=k1_std, family=setup.family,
        added_mass=setup.added, added_mass_std=setup.added_std, eccentricity=run.eccentricity,
        noise=run.noise_of_test, present=(force, motion, beyond),
    )  # fmt: skip
    statics = len({(test.tyre, test.value("pressure")) for test in tests if test.kind == "dynamic"})
    return RigPlan(name, Plan(drawn, setup.rig, setup.channels, run.cycles, max(statics, 1), ADDED_MASS_STD), tests)


def bare_plan(
    rig: Rig,
    guess: Guess,
    run: Run,
    frequencies: Sequence[float],
    *,
    preload: float | None = None,
    rig_std: float | None = None,
    gain_std: float | None = None,
    phase_std: float | None = None,
) -> CampaignPlan:
    """Plan of one tyre on a rig, without a campaign: one test at each frequency, and a static test.

    Parameters
    ----------
    rig : Rig
        Its own uncertainties do not count.
    guess : Guess
        With K1, K2 and C.
    run : Run
    frequencies : sequence of float [Hz]
    preload : float [N], optional
        Static load on the tyre.
    rig_std, gain_std, phase_std : float [1], [1], [rad], optional
        Of each of the rig's values, relative, and of each channel; by default as for a campaign that does not state
        them.

    Returns
    -------
    CampaignPlan

    Examples
    --------
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    >>> planned = bare_plan(rig, Guess(110e3, 100e3, 800.0), Run(), [10.0, 16.0])
    >>> [test.name for test in planned.tests], planned.rigs[0].plan.rig.std["moving_mass"]
    (['S1', 'D1', 'D2'], 0.3)
    """
    notes = []
    for given, words in (
        (rig_std, "rig: no uncertainty stated, taken as 2 % of each value (--std-rig)"),
        (gain_std, "channels: no uncertainty of the gains stated, taken as 1 % (--std-gain)"),
        (phase_std, "channels: no uncertainty of the phases stated, taken as 0.5 deg (--std-phase)"),
        (guess.k1_std, "K1: no uncertainty stated, taken as 2 % (--std-k1)"),
    ):
        if given is None:
            notes.append(words)
    relative = DEFAULT_RIG_STD if rig_std is None else rig_std
    values = {name: getattr(rig, name) for name in ("moving_mass", "preload_stiffness", "preload_damping")}
    rig = replace(rig, std={name: relative * value for name, value in values.items() if value})
    channels = ChannelUncertainty(
        np.full(3, DEFAULT_GAIN_STD if gain_std is None else gain_std),
        np.full(3, DEFAULT_PHASE_STD if phase_std is None else phase_std),
    )
    load = {} if preload is None else {"preload": preload}
    tests = tuple(
        Test(f"D{at}", at + 2, f"recordings/D{at}.csv", "dynamic", "tyre", values={**load, "frequency": frequency})
        for at, frequency in enumerate(frequencies, start=1)
    )
    k1, k1_std, k2, c = np.array([_tyre(test, guess, None) for test in tests]).T
    drawn = PlannedTests.of(
        np.asarray(frequencies, dtype=float), k1, k2, c,
        k1_std=k1_std, eccentricity=run.eccentricity, noise=run.noise_of_test,
    )  # fmt: skip
    only = RigPlan("", Plan(drawn, rig, channels, run.cycles, 1, ADDED_MASS_STD), tests)
    static = Test("S1", 2, "recordings/S1.csv", "static", "tyre", values=dict(load))
    return CampaignPlan((only,), (static, *tests), (), (*notes, *_lift_off([only])))


def _whole(guess: Guess) -> bool:
    return None not in (guess.k1, guess.k2, guess.c)


def _k1_assumed(tests: Sequence[Test], guess: Guess, earlier: _Earlier | None) -> bool:
    """Whether the uncertainty of any K1 was taken as usual."""
    if guess.k1_std is not None:
        return False
    stated = all("u(K1)" in test.values for test in tests if test.kind == "dynamic")
    return not stated and (guess.k1 is not None or earlier is None)


def _tyre(test: Test, guess: Guess, earlier: _Earlier | None) -> _Tyre:
    """K1, its standard uncertainty, K2 and C of a planned test."""
    if test.kind == "calibration":
        return 1.0, 0.0, 1.0, 1.0
    known = None if earlier is None or _whole(guess) else earlier.nearest(test)
    k1, k2, c = guess.k1, guess.k2, guess.c
    k1_std: float | None = None
    if k1 is None:
        k1, k1_std = test.value("K1"), test.value("u(K1)")
    if known is not None:
        if k1 is None:
            k1, k1_std = known[:2]
        k2, c = known[2] if k2 is None else k2, known[3] if c is None else c
    for value, option in ((k1, "--k1"), (k2, "--k2"), (c, "--c")):
        if value is None:
            raise CampaignError(
                f"tyre {test.tyre!r} is not known yet: guess it with --k1, --k2 and --c ({option} is missing); "
                "results of an earlier analysis of the campaign serve too"
            )
    assert k1 is not None
    assert k2 is not None
    assert c is not None
    if guess.k1_std is not None:
        k1_std = guess.k1_std * k1
    return k1, _K1_STD * k1 if k1_std is None else k1_std, k2, c


@dataclass(frozen=True)
class _Earlier:
    """Tyres as an earlier analysis found them."""

    rows: list[dict[str, Any]]

    @classmethod
    def of(cls, folder: Path) -> _Earlier | None:
        """From a results folder, if there is one."""
        if not (folder / "dynamic.csv").is_file():
            return None
        wanted = (q.K1.head, q.K1.u_head, q.K2.head, q.C.head)
        frame = read_results(folder).dynamic.drop_nulls(wanted)
        frame = frame.filter(pl.all_horizontal(pl.col(name) > 0 for name in wanted if not name.startswith("u(")))
        return cls(frame.to_dicts())

    def nearest(self, test: Test) -> tuple[float, float, float, float] | None:
        """K1, u(K1), K2, C of the test of the same tyre whose pressure, preload and frequency are nearest."""
        rows = [row for row in self.rows if row["tyre"] == test.tyre]
        if not rows:
            return None

        def apart(row: dict[str, Any]) -> tuple[float, float]:
            state = sum(_off(row[f"{name} [{unit}]"], test.value(name)) for name, unit in _STATE)
            return round(state, 3), _off(row[q.FREQUENCY.head], test.value("frequency"))

        row = min(rows, key=apart)
        return row[q.K1.head], row[q.K1.u_head], row[q.K2.head], row[q.C.head]


_STATE = (("pressure", "Pa"), ("preload", "N"))


def _off(one: float | None, other: float | None) -> float:
    """How far two positive values are apart, in their logarithms."""
    if not one or not other:
        return 0.0 if one == other else 1.0
    return abs(float(np.log(one / other)))


def _lift_off(rigs: Sequence[RigPlan]) -> list[str]:
    """Tests whose force would come near the load on the tyre."""
    names = []
    for item in rigs:
        force = np.abs(planned_phasors(item.plan.tests, item.plan.rig).force_in)
        load = np.array([test.value("preload") or np.inf for test in item.tests])
        names += [item.tests[at].name for at in np.flatnonzero(force > 0.9 * load)]
    if not names:
        return []
    listed = ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
    return [f"the tyre will nearly lift off in {listed}: take a smaller eccentricity or a higher preload"]


def with_kg(mass: float) -> str:
    """What the column ``plan`` says of a plan with all tests once more and a mass added."""
    return f"with {mass:g} kg"


def plan_table(planned: CampaignPlan, masses: Sequence[float]) -> pl.DataFrame:
    """plan.csv: the uncertainty to expect of each test by each route, as stated and with each of some masses.

    With a mass, every test that has none is run once more with it; the joint route then has a row for all of them,
    each other route, for which nothing changes in the tests without it, for those with the mass.

    Parameters
    ----------
    planned : CampaignPlan
    masses : sequence of float [kg]

    Returns
    -------
    polars.DataFrame
        A row per plan, rig, route and test.
    """
    rows: list[dict[str, Any]] = []
    for item in planned.rigs:
        count = len(item.tests)
        bare = item.plan.tests.bare
        for route in item.plan.routes:
            rows += _rows(item, item.plan, route, AS_STATED, range(count), item.tests)
        for mass in masses if bare.size else ():
            more = item.plan.with_mass(mass)
            tests = (*item.tests, *(item.tests[at] for at in bare))
            for route in item.plan.routes:
                which = range(0 if route == "joint" else count, len(tests))
                rows += _rows(item, more, route, with_kg(mass), which, tests)
    return pl.DataFrame(rows, infer_schema_length=None).with_columns(
        pl.col(pl.Float64).fill_nan(None),
    )


def _rows(
    item: RigPlan, plan: Plan, route: str, name: str, which: Sequence[int], tests: Sequence[Test]
) -> list[dict[str, Any]]:
    found = plan.expect(route)
    relative: FloatArray = relative_uncertainties(found)
    of_k1 = np.abs(arm_by_k1(plan.tests)) * plan.tests.k1_std[:, None]
    rows = []
    for at in which:
        test = tests[at]
        if plan.tests.rigid[at]:
            continue
        rows.append(
            {
                "plan": name,
                "rig": item.name,
                "test": test.name,
                "tyre": test.tyre,
                q.PRESSURE.head: _float(test.value("pressure")),
                q.PRELOAD.head: _float(test.value("preload")),
                q.ADDED_MASS.head: float(plan.tests.added_mass[at]),
                q.FREQUENCY.head: float(plan.tests.frequency[at]),
                "route": route,
                **tyre_cells(found, at),
                q.K2.u_head_from(q.K1): float(of_k1[at, 0]),
                q.C.u_head_from(q.K1): float(of_k1[at, 1]),
                q.TR_PREDICTED.head: float(found.tr_predicted[at]),
                q.TR.u_head: float(found.tr_std[at]),
                q.K_STAR.relative_head: float(relative[at, 0]),
                q.K2.relative_head: float(relative[at, 1]),
                q.C.relative_head: float(relative[at, 2]),
            }
        )
    return rows


def _float(value: float | None) -> float:
    return float("nan") if value is None else float(value)
