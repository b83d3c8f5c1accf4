"""A whole campaign in software: folder, recordings, and the truth that an analysis should find."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fourpole.virtual.folder import finish, prepare, write_recording
from fourpole.virtual.plan import FREQUENCIES, PRELOADS, PRESSURES, plan_tests
from fourpole.virtual.recordings import cam_frequency, record_dynamic, record_static
from fourpole.virtual.truth import STD_GAIN, STD_PHASE, draw_truth, state, truth_rows
from fourpole.virtual.tyres import CROSS_PLY, RADIAL_PLY, Tyre

__all__ = ["SimulatedCampaign", "simulate_campaign"]


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
) -> SimulatedCampaign:
    """Run both rigs on the virtual tyres and write a campaign folder, with the truth beside it.

    The folder gets campaign.toml, tests.csv, recordings/ and truth.csv. Each tyre has a static test at each
    pressure, and a dynamic one at each pressure, preload, added mass and frequency. Everything but the truth
    looks as a laboratory would leave it: the rig's values and the channels' gains and phases are off within
    what campaign.toml states, the cam's speed ripples and is not quite the stated one, and the channels have
    noise, drift, mains hum and a 16-bit converter.

    Parameters
    ----------
    folder : path
        Made if it does not exist; an earlier virtual campaign in it is replaced.
    seed : int
        The same seed gives the same files. A test's noise does not depend on which tests ran before it.
    clean : bool
        Perfect sensors, a perfect cam at the stated speed, the rig exactly as stated, all digits written.
    progress : callable (done, total)
        Called after each test.
    tyres, pressures, preloads, frequencies, added_masses : sequences of VirtualTyre or ModelTyre, [Pa], [N], [Hz], [kg]
        The conditions. The preload holds with the added mass on. The laws of the built-in tyres are meant
        for 1.0 to 2.4 bar, 1000 to 2000 N and 10 to 24 Hz; a mount without a pressure has not-a-number.
    added_mass_at : (tyre name, pressure [Pa], preload [N])
        Added masses other than 0 are tested at this condition only; by default at all.
    calibration_masses : sequence of float [kg]
        Rigid blocks that take the place of the tyre: tests C1 ... of the kind calibration, at all frequencies,
        with the block's mass as added mass. At 24 Hz the force cell takes up to 23 kg.
    sensors : (std_gain [1], std_phase [rad])
        How well F1, V1 and V2 are known.
    rig_std : mapping of str to float [SI]
        How well moving_mass, preload_stiffness and preload_damping are known, where not as usual.
    rig_error : mapping of str to float [1]
        A misstated rig: the true value is the stated one times 1 + error, not one that is drawn.
    declared : mapping of str to float [SI]
        What the rig has more: tyre_mass, frame_stiffness, preload_loss_factor or input_mass; stated with 2 %.
    undeclared : mapping of str to float [SI]
        What the rig has and campaign.toml does not say: the same parts, or leaf_friction; and errors of a channel,
        in place of those drawn: ``gain F1`` [1], ``phase V2`` [rad] ...

    Returns
    -------
    SimulatedCampaign

    Raises
    ------
    FileError
        If `folder` is a file, or holds something that is not a virtual campaign.
    ValueError
        If a name is unknown or a value out of its range.

    Notes
    -----
    truth.csv has the further parts of the rig and the errors of the channels in further columns, where any of the
    arguments from `calibration_masses` on is given. TR is with friction that of its first harmonic.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     made = simulate_campaign(place, pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 24.0])
    ...     made.tests, sorted(path.name for path in made.folder.iterdir())
    (6, ['campaign.toml', 'recordings', 'tests.csv', 'truth.csv'])
    """
    tests = plan_tests(
        tyres,
        pressures,
        preloads,
        frequencies,
        added_masses=added_masses,
        added_mass_at=added_mass_at,
        calibration_masses=calibration_masses,
    )
    statement = state(clean=clean, sensors=sensors, rig_std=rig_std, declared=declared)
    truth = draw_truth(
        statement,
        np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,))),
        rig_error=rig_error,
        undeclared=undeclared,
    )
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
        rows += truth_rows(test, truth, preloads=preloads, frequency=frequency, more=more)
        if progress is not None:
            progress(done, len(tests))
    finish(target, tests, rows, statement, seed)
    return SimulatedCampaign(folder=target, tests=len(tests), seed=seed)
