"""Planning before the tests: the uncertainties to expect, from a stated rig and a guessed tyre, without recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.campaign import defaults
from fourpole.campaign.channels import ChannelFile
from fourpole.campaign.folder import Campaign, condition_numbers, read_campaign
from fourpole.campaign.ordinary import Ordinary
from fourpole.campaign.row import Test, condition_of
from fourpole.core.arrays import FloatArray
from fourpole.core.components import component
from fourpole.core.condition import Sameness
from fourpole.core.phasor import CHANNELS
from fourpole.core.plan import Plan, PlannedTests
from fourpole.core.plan.expect import arm_std, planned_phasors, relative_uncertainties
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind
from fourpole.errors import CampaignError, RigError
from fourpole.fitting.rows import tyre_columns
from fourpole.planning.expected import Earlier, Guess, Tyre, tyre_of
from fourpole.study.identify import added_masses, channel_uncertainty
from fourpole.words import first_of

#: Value of the column ``plan`` for the tests as tests.csv states them.
AS_STATED = "as stated"
#: Number of recorded cycles to which the noise of a `Run` belongs.
_CYCLES = 40.0
#: A rigid block has no tyre; the numbers keep the equations finite.
_RIGID = Tyre(1.0, 0.0, 1.0, 1.0)
#: Number of tests that a note names.
_NAMED = 6


@dataclass(frozen=True)
class Run:
    """The settings with which each test is run.

    Attributes
    ----------
    noise : float [1]
        Standard uncertainty of Re and of Im of each amplitude over its modulus, after 40 cycles.
    cycles : float [1]
        Number of cycles recorded in each test; the noise is proportional to 1/sqrt(cycles).
    eccentricity : float [m]
        Amplitude of the displacement of the contact.
    """

    noise: float = 1e-4
    cycles: float = _CYCLES
    eccentricity: float = 1e-3

    @property
    def noise_of_test(self) -> float:
        """Relative standard uncertainty of Re and of Im of each amplitude after all cycles [1]."""
        return float(self.noise * np.sqrt(_CYCLES / self.cycles))


@dataclass(frozen=True)
class RigPlan:
    """The planned tests of one rig; `tests` are the rows of tests.csv for the tests of `plan`."""

    name: str
    plan: Plan
    tests: tuple[Test, ...]


@dataclass(frozen=True)
class CampaignPlan:
    """The plan of a campaign.

    Attributes
    ----------
    rigs : tuple of RigPlan
        Dynamic tests and calibrations, one entry per rig.
    tests : tuple of Test
        All tests of the campaign, static and dynamic.
    extra_columns : tuple of str
        Columns of tests.csv that pass through to the run sheet.
    notes : tuple of str
        Sentences: what was assumed, and which tests cannot be run as planned.
    rule : Sameness
        The campaign's rule of one condition.
    """

    rigs: tuple[RigPlan, ...]
    tests: tuple[Test, ...]
    extra_columns: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    rule: Sameness = field(default_factory=Sameness)

    def table(self, masses: Sequence[float] = ()) -> pl.DataFrame:
        """The uncertainties to expect: `plan_table`."""
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
        The guessed tyre. A value that is not given comes from tests.csv (K1), or from an earlier analysis of the
        campaign.
    k1_std : float [1], optional
        Relative standard uncertainty of K1 after the static tests; 2 % where neither this nor tests.csv states one.
    noise : float [1]
        Standard uncertainty of Re and of Im of each amplitude over its modulus, after 40 cycles.
    cycles : float [1]
        Number of cycles recorded in each test; the noise is proportional to 1/sqrt(cycles).
    eccentricity : float [m]
        Amplitude of the displacement of the contact.

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
        The campaign, from `read_campaign`.
    guess : Guess
        The values not guessed come from tests.csv (K1), or from the nearest test of the same tyre in
        CAMPAIGN/results/dynamic.csv.
    run : Run

    Returns
    -------
    CampaignPlan
    """
    planned = _to_plan(campaign)
    rule = campaign.stated.sameness
    earlier = Earlier.of(campaign.folder / "results", rule)
    rigs = []
    for name in dict.fromkeys(test.rig for test in planned):
        tests = tuple(test for test in planned if test.rig == name)
        tyres = [_RIGID if test.kind == "calibration" else tyre_of(test, guess, earlier) for test in tests]
        rigs.append(_rig_plan(campaign, name, tests, tyres, run))
    notes = (*_notes(campaign, planned, guess, earlier), *_lift_off(rigs))
    return CampaignPlan(tuple(rigs), campaign.tests, campaign.extra_columns, notes, rule)


def _notes(campaign: Campaign, planned: Sequence[Test], guess: Guess, earlier: Earlier | None) -> Iterator[str]:
    """What was assumed, and which tests are not planned or planned although they are excluded."""
    yield from campaign.stated.assumptions()
    if earlier is not None and not guess.whole:
        yield f"the specimens are guessed from {campaign.folder.name}/results/dynamic.csv"
    if bands := [test.name for test in campaign.tests if test.band is not None]:
        named = first_of(bands, _NAMED)
        yield f"{named}: random tests and sweeps are not planned, their uncertainty follows from the coherence"
    if left_out := [test.name for test in planned if test.excluded]:
        yield f"tests with a reason in the column excluded are planned as the others: {first_of(left_out, _NAMED)}"
    stated = all("u(K1)" in test.values for test in planned if test.kind == "dynamic")
    if guess.k1_std is None and not stated and (guess.k1 is not None or earlier is None):
        yield "K1: no uncertainty stated, taken as 2 % (--std-k1)"


def _to_plan(campaign: Campaign) -> list[Test]:
    """The dynamic tests and calibrations of a campaign; CampaignError where one of them cannot be planned."""
    planned = [test for test in campaign.tests if test.kind != "static" and test.band is None]
    if not planned and any(test.band is not None for test in campaign.tests):
        raise CampaignError(
            "tests.csv: all dynamic tests are of kind random or sweep, and a plan is for sines: state a few sines in "
            "their band, as kind dynamic"
        )
    if not planned:
        raise CampaignError("tests.csv: lists no dynamic test, so there is nothing to plan")
    for test in planned:
        if test.problem and not test.excluded:
            raise CampaignError(test.problem)
        if test.value("frequency") is None:
            raise CampaignError(f"tests.csv row {test.row}: frequency [Hz] is blank: a plan needs one for each test")
    return planned


def _rig_plan(campaign: Campaign, name: str, tests: tuple[Test, ...], tyres: Sequence[Tyre], run: Run) -> RigPlan:
    """The plan of the tests of one rig, for the guessed tyre of each test."""
    stated = campaign.stated.all_rigs.get(name)
    if stated is None:
        raise RigError("campaign.toml: [rig] is missing: a plan needs moving_mass and preload_stiffness")
    force, motion, beyond = (campaign.stated.channels.named(role) is not None for role in CHANNELS)
    if not motion or not (force or beyond):
        raise CampaignError("campaign.toml: [channels] a plan needs motion_in and one of force_in and motion_out")
    added, added_std = added_masses(tests)
    labels = {"specimen": [test.tyre for test in tests], "mounting": [test.mounting for test in tests]}
    expected = _expected(
        tests, tyres, run, family=condition_numbers(campaign, tests), added_mass=added, added_mass_std=added_std,
        present=(force, motion, beyond),
        **{name: np.unique(np.array(texts), return_inverse=True)[1].ravel() for name, texts in labels.items()},
    )  # fmt: skip
    # Static tests of one specimen, pressure and temperature give one K1, whatever the preload of the dynamic tests is.
    rule = campaign.stated.sameness.without("preload")
    statics = set(rule.groups([condition_of(test, rule) for test in tests if test.kind == "dynamic"]).tolist())
    top = float(expected.frequency.max())
    rig, channels = stated.rig(), channel_uncertainty(campaign, (), top)
    specimens = campaign.stated.specimen_uncertainty
    plan = Plan(expected, rig, channels, specimens, run.cycles, max(len(statics), 1), defaults.MASS_STD)
    return RigPlan(name, plan, tests)


def _expected(tests: Sequence[Test], tyres: Sequence[Tyre], run: Run, **more: Any) -> PlannedTests:
    """The planned tests, each with its assumed tyre and noise; `more` are further attributes of `PlannedTests`."""
    k1, k1_std, k2, c = np.array([astuple(tyre) for tyre in tyres]).T
    frequency = np.array([test.values["frequency"] for test in tests])
    more |= {"k1_std": k1_std, "eccentricity": run.eccentricity, "noise": run.noise_of_test}
    return PlannedTests(frequency, k1, k2, c, **more)


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
        The rig; `rig_std` replaces its standard uncertainties.
    guess : Guess
        The assumed tyre, with K1, K2 and C.
    run : Run
    frequencies : sequence of float [Hz]
    preload : float [N], optional
        Static load on the tyre.
    rig_std, gain_std, phase_std : float [1], [1], [rad], optional
        Standard uncertainties: relative, of each value of the rig; of the gain and of the phase of each channel. The
        defaults are those of a campaign that does not state them.

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
    taken = {
        "rig: no uncertainty stated, taken as 2 % of each value (--std-rig)": rig_std,
        "channels: no uncertainty of the gains stated, taken as 1 % (--std-gain)": gain_std,
        "channels: no uncertainty of the phases stated, taken as 0.5 deg (--std-phase)": phase_std,
        "K1: no uncertainty stated, taken as 2 % (--std-k1)": guess.k1_std,
    }
    notes = [note for note, stated in taken.items() if stated is None]
    relative = defaults.RIG_STD if rig_std is None else rig_std
    values = {name: getattr(rig, name) for name in ("moving_mass", "preload_stiffness", "preload_damping")}
    rig = replace(rig, std={name: relative * value for name, value in values.items() if value})
    ordinary, channel = Ordinary(), ChannelFile.model_validate({"column": "-"})
    channel = channel.model_copy(update={"std_gain": gain_std, "std_phase": phase_std})
    channels = ordinary.uncertainty(dict.fromkeys(CHANNELS, channel), max(frequencies))
    if not rig.preload_damping and not rig.blocked:
        rig = replace(rig, std={**rig.std, "preload_damping": component(Kind.RIG_VALUE).std * rig.critical_damping})
    load = {} if preload is None else {"preload": preload}
    tests = tuple(
        Test(f"D{at}", at + 2, f"recordings/D{at}.csv", "dynamic", "tyre", values={**load, "frequency": frequency})
        for at, frequency in enumerate(frequencies, start=1)
    )
    expected = _expected(tests, [tyre_of(test, guess, None) for test in tests], run)
    specimens = ordinary.specimens(None, None)
    only = RigPlan("", Plan(expected, rig, channels, specimens, run.cycles, 1, defaults.MASS_STD), tests)
    static = Test("S1", 2, "recordings/S1.csv", "static", "tyre", values=dict(load))
    return CampaignPlan((only,), (static, *tests), (), (*notes, *_lift_off([only])))


def _lift_off(rigs: Sequence[RigPlan]) -> list[str]:
    """A note on the tests whose dynamic force comes near the static load on the tyre; empty where there is none."""
    names = []
    for item in rigs:
        force = np.abs(planned_phasors(item.plan.tests, item.plan.rig).force_in)
        load = np.array([np.inf if test.fixed else test.value("preload") or np.inf for test in item.tests])
        names += [item.tests[at].name for at in np.flatnonzero(force > 0.9 * load)]
    if not names:
        return []
    return [f"the specimen will nearly lift off in {first_of(names, _NAMED)}: take less eccentricity or more preload"]


def with_kg(mass: float) -> str:
    """Value of the column ``plan`` for the plan in which all tests are run once more with a mass added."""
    return f"with {mass:g} kg"


def plan_table(planned: CampaignPlan, masses: Sequence[float]) -> pl.DataFrame:
    """The table of plan.csv: the expected uncertainty of each test by each route, as stated and with added masses.

    In a plan with a mass, every test without a mass is repeated with it. The joint route then has a row for every test.
    Each other route has rows for the repeated tests only, because its results for the first tests do not change.

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
    return pl.DataFrame(rows, infer_schema_length=None).cast({pl.Null: pl.Float64}).fill_nan(None)


def _rows(
    item: RigPlan, plan: Plan, route: str, name: str, which: Sequence[int], tests: Sequence[Test]
) -> list[dict[str, Any]]:
    found = plan.expect(route)
    relative: FloatArray = relative_uncertainties(found)
    of_k1 = arm_std(plan.tests, 0.0, plan.tests.k1_std)
    columns = {head: column for head, column in tyre_columns(found).items() if head not in q.LOSS_FACTOR.heads}
    columns |= {q.K2.u_head_from(q.K1): of_k1[:, 0], q.C.u_head_from(q.K1): of_k1[:, 1]}
    columns |= {q.TR_PREDICTED.head: found.tr_predicted, q.TR.u_head: found.tr_std}
    columns |= {one.relative_head: relative[:, place] for place, one in enumerate((q.K_STAR, q.K2, q.C))}
    return [
        {
            "plan": name,
            "rig": item.name,
            "test": tests[at].name,
            "tyre": tests[at].tyre,
            q.PRESSURE.head: tests[at].value("pressure"),
            q.PRELOAD.head: tests[at].value("preload"),
            q.ADDED_MASS.head: float(plan.tests.added_mass[at]),
            q.FREQUENCY.head: float(plan.tests.frequency[at]),
            "route": route,
            **{head: float(column[at]) for head, column in columns.items()},
        }
        for at in which
        if not plan.tests.rigid[at]
    ]
