"""A whole campaign in software: folder, recordings, and the truth that an analysis should find.

That of `fourpole demo` has a car's tyre, and behind it the two of the 1982 paper, named as laboratories do.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isnan, radians
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.virtual.folder import finish, prepare, truth_rows, write_recording
from fourpole.virtual.plan import FREQUENCIES, PRELOADS, PRESSURES, SERIES, Planned, plan_tests, with_inertia
from fourpole.virtual.recordings import (
    STD_GAIN,
    STD_PHASE,
    cam_frequency,
    draw_truth,
    record_dynamic,
    record_static,
    state,
)
from fourpole.virtual.tyres import BELTED, CAR_TYRE, CROSS_PLY, RADIAL_PLY, ModelTyre, Tyre


@dataclass(frozen=True)
class SimulatedCampaign:
    """The campaign that `simulate_campaign` wrote.

    Parameters
    ----------
    folder : Path
    tests : int
        Static and dynamic tests together.
    seed : int
    """

    folder: Path
    tests: int
    seed: int


def simulate_campaign(
    folder: str | os.PathLike[str],
    *,
    seed: int = 1982,
    clean: bool = False,
    progress: Callable[[int, int], None] | None = None,
    tyres: Sequence[Tyre] = (CROSS_PLY, RADIAL_PLY),
    pressures: Sequence[float] = PRESSURES,
    preloads: Sequence[float] = PRELOADS,
    frequencies: Sequence[float] = FREQUENCIES,
    added_masses: Sequence[float] = (0.0,),
    added_mass_at: tuple[str, float, float] | None = None,
    calibration_masses: Sequence[float] = (),
    sensors: tuple[float, float] = (STD_GAIN, STD_PHASE),
    rig_std: Mapping[str, float] | None = None,
    rig_error: Mapping[str, float] | None = None,
    declared: Mapping[str, float] | None = None,
    undeclared: Mapping[str, float] | None = None,
    repeats: int = 1,
    faults: Sequence[object] = (),
    mounts: Sequence[ModelTyre] = (),
    eccentricity: float = 1e-3,
    tests: Sequence[Planned] = (),
    report: Mapping[str, str] | None = None,
) -> SimulatedCampaign:
    """Simulate static and dynamic tests of virtual tyres and write them as a campaign folder, with the true values.

    The folder gets campaign.toml, tests.csv, recordings/ and truth.csv. Each tyre has a static test at each
    pressure, and a dynamic test at each pressure, preload, added mass and frequency. The recordings have the errors of
    a laboratory: the rig's values and the channels' gains and phases differ from the statement within the stated
    uncertainty. The cam's speed has ripple and differs a little from the stated one. The channels have noise, drift,
    mains hum and a 16-bit converter.

    Parameters
    ----------
    folder : path
        Created if it does not exist; an earlier virtual campaign in it is replaced.
    seed : int
        The same seed gives the same files. A test's noise does not depend on which tests ran before it.
    clean : bool
        Perfect sensors, a perfect cam at the stated speed, the rig exactly as stated, all digits written.
    progress : callable (done, total)
        Called after each test.
    tyres, pressures, preloads, frequencies, added_masses : sequences of VirtualTyre or ModelTyre, [Pa], [N], [Hz], [kg]
        The conditions. By default the tyres are massless, as in the 1982 paper; `BELTED` has the two of `fourpole demo`
        and `fourpole simulate`. The preload includes the weight of the added mass. The built-in tyres are valid for 1.0
        to 2.4 bar, 1000 to 2000 N and 10 to 24 Hz. The pressure of a mount without inflation is not-a-number.
    added_mass_at : (tyre name, pressure [Pa], preload [N])
        Added masses other than 0 are tested at this condition only; by default at all conditions.
    calibration_masses : sequence of float [kg]
        Rigid blocks that take the place of the tyre: tests C1 ... of the kind calibration, at all frequencies,
        with the block's mass as added mass. At 24 Hz the force cell takes up to 23 kg.
    sensors : (std_gain [1], std_phase [rad])
        Stated standard uncertainties of the gains and phases of F1, V1 and V2.
    rig_std : mapping of str to float [SI]
        Stated standard uncertainties of moving_mass, preload_stiffness and preload_damping, in place of the defaults.
    rig_error : mapping of str to float [1]
        Errors of a misstated rig: the true value is the stated one times 1 + error, in place of a random value.
    declared : mapping of str to float [SI]
        Further parts of the rig, stated with 2 %: tyre_mass, frame_stiffness, preload_loss_factor or input_mass.
    undeclared : mapping of str to float [SI]
        Parts of the rig that campaign.toml does not state: the same parts, or leaf_friction. Also errors of a channel
        in place of random ones: ``gain F1`` [1], ``phase V2`` [rad] ..., ``gain F`` and ``gain x`` of the static rig.
    repeats : int
        How often all dynamic tests are done, one series after the other.
    faults : sequence
        Must be empty: laboratories with faults are made by `benchmark/elastomer_truth` of the repository.
    mounts : sequence of ModelTyre
        Specimens without inflation: each has a static test, and a dynamic test at the first preload and each frequency.
        Their tests come after those of the tyres, whose files they do not change.
    eccentricity : float [m]
        Amplitude of the motion of the contact; > 0.
    tests : sequence of Planned
        The tests, in place of those at all combinations of the conditions.
    report : mapping of str to str
        What campaign.toml states under [report], such as laboratory and operator.

    Returns
    -------
    SimulatedCampaign

    Raises
    ------
    FileError
        If `folder` is a file, or holds something that is not a virtual campaign.
    ValueError
        If a name is unknown, a value is out of its range, or there are faults.

    Notes
    -----
    If any of the arguments from `calibration_masses` on is given, truth.csv has further columns: the further parts of
    the rig and the errors of the channels. With friction, TR is that of the first harmonic.

    K* in truth.csv is that of a specimen's springs, TR that of its two ends. If a specimen has a mass of its own,
    truth.csv has further columns about it. `CAR_TYRE` resonates on the rig, and lifts off the cam unless its
    eccentricity is small, such as 0.2 mm.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     made = simulate_campaign(place, pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 24.0])
    ...     made.tests, sorted(path.name for path in made.folder.iterdir())
    (6, ['campaign.toml', 'recordings', 'tests.csv', 'truth.csv'])
    """
    if faults:
        raise ValueError(
            "faults= has left simulate_campaign: benchmark/elastomer_truth in Fourpole's repository makes laboratories "
            "with faults that their files do not mention (docs/benchmark.md); leave out faults"
        )
    tests = tests or plan_tests(
        tyres,
        pressures,
        preloads,
        frequencies,
        added_masses=added_masses,
        added_mass_at=added_mass_at,
        calibration_masses=calibration_masses,
        repeats=repeats,
        mounts=mounts,
        eccentricity=eccentricity,
    )
    statement = state(clean=clean, sensors=sensors, rig_std=rig_std, declared=declared)
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
    truth = draw_truth(statement, rng, rig_error=rig_error, undeclared=undeclared)
    inertia = with_inertia(tests)
    usual = tuple(sensors) == (STD_GAIN, STD_PHASE)
    more = not usual or any((calibration_masses, rig_std, rig_error, declared, undeclared))
    target = prepare(Path(folder), tests)
    rows: list[tuple[object, ...]] = []
    for done, test in enumerate(tests, start=1):
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, *test.name.encode())))
        frequency = cam_frequency(test, rng, clean)
        if test.kind == "static":
            columns, decimals = record_static(test, truth, rng, clean), 4
        else:
            columns, decimals = record_dynamic(test, frequency, truth, rng, clean), 6
        write_recording(columns, target / "recordings" / f"{test.name}.csv", None if clean else decimals)
        rows += truth_rows(test, truth, preloads=preloads, frequency=frequency, more=more, inertia=inertia)
        if progress is not None:
            progress(done, len(tests))
    finish(target, tests, rows, statement, seed, report or {})
    return SimulatedCampaign(folder=target, tests=len(tests), seed=seed)


#: Pressures of the car's tyre [Pa] and its only preload [N].
_PRESSURES, _PRELOAD = (180e3, 210e3, 240e3), 2000.0
#: Frequencies [Hz]; the pressures of the paper's tyres are every other one of the paper.
_FREQUENCIES = (10.0, 12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0)
#: Mass that is added at one condition [kg], and amplitude of the contact below the car's tyre, which resonates [m].
_ADDED, _ECCENTRICITY = 10.0, 0.2e-3
_REPORT = {
    "laboratory": "Prüfstand 2 (virtual), Köln",
    "operator": "J. Müller (virtual)",
    "tested": "2026-11-02 to 2026-11-05",
    "method": "steady sines of a cam, 10 to 24 Hz; static loops",
}


def demo_settings() -> dict[str, Any]:
    """Arguments of `simulate_campaign` for the demonstration.

    Returns
    -------
    dict
        The tests, sensors of 0.5 % and 0.2°, the rig's uncertainties, and what the report says of the laboratory.

    Examples
    --------
    >>> tests = demo_settings()["tests"]
    >>> len(tests), tests[0].name, tests[-1].name
    (137, 'Köln_car-tyre_1.8bar_static', 'Köln_radial-ply_2.4bar_2000N_24Hz')
    """
    car = plan_tests(
        [CAR_TYRE],
        _PRESSURES,
        [_PRELOAD],
        _FREQUENCIES,
        added_masses=(0.0, _ADDED),
        added_mass_at=(CAR_TYRE.name, _PRESSURES[1], _PRELOAD),
        eccentricity=_ECCENTRICITY,
    )
    paper = plan_tests(BELTED, PRESSURES[::2], PRELOADS, _FREQUENCIES)
    return {
        "tests": list(_named([*car, *paper])),
        "sensors": (5e-3, radians(0.2)),
        "rig_std": {"moving_mass": 0.15, "preload_stiffness": 120.0, "preload_damping": 5.0},
        "report": _REPORT,
    }


def _named(tests: list[Planned]) -> Iterator[Planned]:
    """The tests, named by their conditions."""
    for test in tests:
        of_sine = "static" if isnan(test.frequency) else f"{test.preload:.4g}N_{test.frequency:.4g}Hz"
        mass = f"_{test.added_mass:.4g}kg" if test.added_mass else ""
        yield replace(test, name=f"{SERIES}_{test.mounted.name}_{test.pressure / 1e5:.4g}bar_{of_sine}{mass}")
