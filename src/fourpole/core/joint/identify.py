"""The joint route in the form of every route's answer."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.identification import Identification
from fourpole.core.joint.joint import solve_joint
from fourpole.core.joint.outputs import identification
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig

__all__ = ["identify_joint"]


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
) -> Identification:
    r"""Find K* of every condition, the rig's values and the channels' gains from all tests of a rig together.

    Maximises the posterior of: per test a free drive, per condition K* (carried to each test's own frequency by the
    slopes of 1/K2 and 1/C, or of log K* where K1 is unknown), and the shared values with what is stated of them as
    priors. See `fourpole.core.joint.model` for the model.

    Parameters
    ----------
    phasors : Phasors
        N tests; not-a-number where a channel is absent, at least two of the three per test.
    rig : Rig
        As stated, with its uncertainties.
    k1, k1_std : (N,) float arrays [N/m]
        Static stiffness and its standard uncertainty; not-a-number where unknown: K* is found all the same.
    family : (N,) int array
        Tests with the same number have the same tyre, pressure and preload; negative: a rigid block in place of the
        tyre, its mass within `added_mass`.
    nominal_frequency : (N,) float array [Hz]
        As stated, which tells repeats from a fine sweep; not-a-number where it is not.
    added_mass, added_mass_std : (N,) float arrays [kg]
        Mass fixed to the moving mass; one error common to all tests with the same mass.
    channels : ChannelUncertainty, optional
        What is not known of the channels; without it they count as exact.

    Returns
    -------
    Identification
        One row per test, K* blank for rigid blocks; its `joint` has the rig's values and the channels' gains as found.

    Raises
    ------
    RigError
        If the rig is blocked, so that there is nothing to join.

    Examples
    --------
    A moving mass stated as 15.0 ± 0.3 kg, that is 15.2 kg:

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
    )
    return identification(joint, phasors, k1, k1_std)
