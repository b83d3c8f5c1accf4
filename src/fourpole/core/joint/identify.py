"""The joint route with the result type of every route."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.identification import Identification
from fourpole.core.joint.joint import solve_joint
from fourpole.core.joint.outputs import identification
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig


def identify_joint(
    phasors: Phasors,
    rig: Rig,
    k1: ArrayLike = np.nan,
    *,
    k1_std: ArrayLike = 0.0,
    family: ArrayLike = 0,
    nominal_frequency: ArrayLike = np.nan,
    added_mass: ArrayLike = 0.0,
    added_mass_std: ArrayLike = 0.0,
    channels: ChannelUncertainty | None = None,
    specimen: Sequence[str] | None = None,
    time: ArrayLike | None = None,
    apart: ArrayLike = 0.0,
    lines: ArrayLike = 1.0,
    recording: ArrayLike | None = None,
) -> Identification:
    r"""Find K* of every condition, the rig's values and the channels' gains from all tests of a rig together.

    The result maximises the posterior of a free drive for each test, K* for each condition, and the shared values with
    their statements as priors. K* is interpolated to the frequency of each test by the slopes of 1/K2 and 1/C, or of
    log K* if K1 is unknown. `fourpole.core.joint.model` documents the model.

    Parameters
    ----------
    phasors : Phasors
        Phasors of N tests; not-a-number for an absent channel. Each test needs at least two of the three channels.
    rig : Rig
        The rig as stated, with its uncertainties.
    k1, k1_std : (N,) float arrays [N/m]
        Static stiffness and its standard uncertainty. Not-a-number if unknown; K* does not need it.
    family : (N,) int array
        Number of the condition without its frequency: specimen, pressure, preload, temperature and others. A negative
        number is a rigid block in place of the tyre, whose mass is part of `added_mass`.
    nominal_frequency : (N,) float array [Hz]
        Frequency as stated, which distinguishes repeats from a fine sweep; not-a-number if not stated.
    added_mass, added_mass_std : (N,) float arrays [kg]
        Mass fixed to the moving mass, and its standard uncertainty; tests with the same mass share one error.
    channels : ChannelUncertainty, optional
        Uncertainties of the channels; without it the channels count as exact.
    specimen : sequence of N str, optional
        Name of the specimen of each test; by default all tests are of one specimen.
    time : (N,) float array, optional
        Time of each test, in any unit, along which a specimen may drift; by default the order of the tests.
    apart : (N,) float array [1]
        Standard deviation of log K* of each test about that of its condition, as from another temperature.
    lines : (N,) float array [1]
        Number of lines of the recording that a test is one of: their K* scatters together.
    recording : (N,) int array, optional
        Number of the recording that a test is a line of: each of its lines has a K* of its own.

    Returns
    -------
    Identification
        One row per test, with K* not-a-number for rigid blocks. `joint` has the estimates of the rig's values and of
        the channels' gains.

    Raises
    ------
    RigError
        If the rig is blocked, so that there is no V2.

    References
    ----------
    JCGM 102:2011, 6.3 (covariance of outputs that solve a measurement model), and 6.4 (complex quantities).

    Examples
    --------
    A moving mass of 15.2 kg that is stated as 15.0 ± 0.3 kg:

    >>> omega = 2 * np.pi * np.array([10.0, 12.0])
    >>> impedance = Rig(moving_mass=15.2, preload_stiffness=12440.0).impedance(omega)
    >>> ratio = (2e5 + 4e4j) / (2e5 + 4e4j + 1j * omega * impedance)
    >>> amplitudes = 0.06 * np.stack([impedance * ratio, np.ones(2), ratio], axis=1)
    >>> nothing = np.zeros(2)
    >>> phasors = Phasors(omega / (2 * np.pi), amplitudes, np.zeros((2, 6, 6)), nothing, nothing + np.inf)
    >>> found = identify_joint(phasors, Rig(moving_mass=15.0, preload_stiffness=12440.0, std={"moving_mass": 0.3}))
    >>> found.joint.found.round(4), found.stiffness.round(0)
    (array([15.2]), array([200000.+40000.j, 200000.+40000.j]))
    """
    joint = solve_joint(
        phasors,
        rig,
        k1,
        family=family,
        nominal_frequency=nominal_frequency,
        added_mass=added_mass,
        added_mass_std=added_mass_std,
        channels=channels,
        specimen=specimen,
        time=time,
        apart=apart,
        lines=lines,
        recording=recording,
    )
    return identification(joint, phasors, k1, k1_std)
