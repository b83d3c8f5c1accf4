r"""The uncertainty that the analysis of planned tests would state, before any of them is run.

An assumed tyre on the stated rig gives the phasors that the tests would show without noise. They are identified like
measured phasors, with the covariance of the expected noise, so that plan and analysis share every formula. For the
joint route the residual is zero, and the covariance is the inverse of the Fisher information of tests and statements
together: the bound of Cramér, Rao and van Trees.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.components import SpecimenUncertainty
from fourpole.core.curvature import arm_covariance
from fourpole.core.identify import Identification, identify
from fourpole.core.joint import identify_joint
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import ROUTES
from fourpole.core.tyre import zener_stiffness

#: Every route, in the order of tables and figures.
PLAN_ROUTES = (*ROUTES, "joint")
#: Indices of the channels F1, V1, V2 that each route needs.
_NEEDS = {"mobility": (0, 1), "relative": (0, 1, 2), "transmissibility": (1, 2)}
_ALL = (True, True, True)
#: Columns of planned tests that are numbers of something.
_NUMBERS = ("family", "specimen", "mounting")


@dataclass(frozen=True, eq=False)
class PlannedTests(ByValue):
    """N planned dynamic tests of a rig, with an assumed tyre: one value per test, or one value for all.

    Attributes
    ----------
    frequency : (N,) float array [Hz]
        Excitation frequency, > 0.
    k1, k2, c : (N,) float arrays [N/m], [N/m], [N s/m]
        Assumed values of the tyre, > 0.
    k1_std : (N,) float array [N/m]
        Expected standard uncertainty of K1.
    family : (N,) int array
        Number of tyre, pressure and preload. A negative number is a rigid block in place of the tyre, whose mass is
        part of `added_mass`.
    added_mass, added_mass_std : (N,) float arrays [kg]
        Mass fixed to the moving mass, and its standard uncertainty; tests with the same mass share one error.
    eccentricity : (N,) float array [m]
        Amplitude of the motion of the contact.
    noise : (N,) float array [1]
        Standard uncertainty of Re and of Im of each amplitude, relative to its modulus.
    specimen, mounting : (N,) int arrays
        Numbers of the specimen, and of the mounting of V1's sensor.
    present : (F1, V1, V2) of bool
        Channels that will be recorded.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Examples
    --------
    >>> PlannedTests([10.0, 12.0], 180e3, 120e3, 700.0).k2.tolist()
    [120000.0, 120000.0]
    """

    frequency: FloatArray
    k1: FloatArray
    k2: FloatArray
    c: FloatArray
    k1_std: FloatArray = field(default_factory=lambda: np.array(0.0))
    family: np.ndarray = field(default_factory=lambda: np.array(0))
    added_mass: FloatArray = field(default_factory=lambda: np.array(0.0))
    added_mass_std: FloatArray = field(default_factory=lambda: np.array(0.0))
    eccentricity: FloatArray = field(default_factory=lambda: np.array(1e-3))
    noise: FloatArray = field(default_factory=lambda: np.array(1e-4))
    specimen: np.ndarray = field(default_factory=lambda: np.array(0))
    mounting: np.ndarray = field(default_factory=lambda: np.array(0))
    present: tuple[bool, bool, bool] = _ALL

    def __post_init__(self) -> None:
        """Make an array of every attribute but `present`."""
        given = (np.asarray(getattr(self, name), dtype=int if name in _NUMBERS else float) for name in _COLUMNS)
        for name, value in zip(_COLUMNS, np.broadcast_arrays(np.ones(1), *given)[1:], strict=True):
            object.__setattr__(self, name, value)
        positive = (self.frequency, self.k1, self.k2, self.c, self.eccentricity)
        if not all(np.all(np.isfinite(values) & (values > 0)) for values in positive):
            raise ValueError("frequency, K1, K2, C and eccentricity of a planned test must be finite and positive")
        others = (self.k1_std, self.added_mass, self.added_mass_std, self.noise)
        if not all(np.all(np.isfinite(values) & (values >= 0)) for values in others):
            raise ValueError("uncertainties, added mass and noise of a planned test must be zero or positive")

    @property
    def rigid(self) -> BoolArray:
        """Flags (N,) of the tests with a rigid block in place of the tyre."""
        return np.asarray(self.family < 0)

    @property
    def bare(self) -> np.ndarray:
        """Indices of the tests with a tyre and without an added mass."""
        return np.flatnonzero(~self.rigid & (self.added_mass == 0))

    def __len__(self) -> int:
        return self.frequency.size

    @property
    def stiffness(self) -> ComplexArray:
        """K* of the assumed tyre (N,) [N/m]."""
        return np.asarray(zener_stiffness(self.k1, self.k2, self.c, 2 * np.pi * self.frequency))

    def part(self, which: ArrayLike) -> PlannedTests:
        """Some of the tests, by an index array or flags."""
        rows = np.asarray(which)
        columns: dict[str, Any] = {name: getattr(self, name)[rows] for name in _COLUMNS}
        return replace(self, **columns)

    def with_mass(self, mass: float, std: float, which: ArrayLike) -> PlannedTests:
        """All tests, followed by repeats of some of them with a mass fixed to the moving mass.

        Parameters
        ----------
        mass, std : float [kg]
            The mass and its standard uncertainty.
        which : (n,) int or (N,) bool array
            The tests to repeat.

        Examples
        --------
        >>> PlannedTests([10.0, 12.0], 180e3, 120e3, 700.0).with_mass(10.0, 1e-3, [0]).added_mass.tolist()
        [0.0, 0.0, 10.0]
        """
        more = self.part(which)
        same = np.ones(len(more))
        return self.followed_by(replace(more, added_mass=mass * same, added_mass_std=std * same))

    def followed_by(self, *others: PlannedTests) -> PlannedTests:
        """These tests, followed by others."""
        parts = (self, *others)
        columns: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS}
        return replace(self, **columns)


_COLUMNS = tuple(field.name for field in fields(PlannedTests) if field.name != "present")


def possible_routes(rig: Rig, present: tuple[bool, bool, bool] = _ALL) -> tuple[str, ...]:
    """Routes that are possible with a rig and the recorded channels, in the order of `PLAN_ROUTES`.

    Examples
    --------
    >>> possible_routes(Rig(moving_mass=15.0, preload_stiffness=12440.0))[-1]
    'joint'
    >>> possible_routes(Rig(moving_mass=15.0, preload_stiffness=12440.0), (True, True, False))
    ('mobility',)
    """
    routes = [route for route in ROUTES if all(present[channel] for channel in _NEEDS[route])]
    if rig.blocked:
        return tuple(route for route in routes if route == "mobility")
    return (*routes, "joint") if all(present) else tuple(routes)


def planned_phasors(tests: PlannedTests, rig: Rig) -> Phasors:
    r"""Phasors that planned tests would show without noise, with the covariance of the expected noise.

    .. math:: V_1 = j\omega e, \quad V_2 = T V_1, \quad F_1 = (Z_r T + j\omega m_{in})\,V_1,
        \qquad T = \frac{K^*}{K^* + j\omega Z_r}

    Parameters
    ----------
    tests : PlannedTests
    rig : Rig

    Returns
    -------
    Phasors
        Amplitudes are not-a-number for channels that are not recorded.

    Examples
    --------
    >>> tests = PlannedTests(10.0, 180e3, 120e3, 700.0)
    >>> abs(planned_phasors(tests, Rig(moving_mass=15.0, preload_stiffness=12440.0)).transmissibility).round(3)
    array([1.299])
    """
    jw = 2j * np.pi * tests.frequency
    stiffness, v1 = tests.stiffness, jw * tests.eccentricity
    if rig.blocked:
        ratio, force = np.zeros_like(v1), stiffness / jw
    else:
        added = tests.added_mass - np.where(tests.rigid, rig.tyre_mass, 0.0)
        impedance = np.asarray(rig.impedance(2 * np.pi * tests.frequency, added))
        ratio = np.where(tests.rigid, 1.0, stiffness / (stiffness + jw * impedance))
        force = impedance * ratio
    amplitudes = np.stack([(force + jw * rig.input_mass) * v1, v1, ratio * v1], axis=-1)
    std = np.repeat(tests.noise[:, None] * np.abs(amplitudes), 2, axis=1)
    covariance = np.zeros((len(tests), 6, 6))
    covariance[:, range(6), range(6)] = std**2
    amplitudes[:, ~np.array(tests.present)] = np.nan
    zero = np.zeros(len(tests))
    return Phasors(tests.frequency, amplitudes, covariance, zero, zero + np.inf)


def expect(
    tests: PlannedTests,
    rig: Rig,
    route: str = "joint",
    *,
    channels: ChannelUncertainty | None = None,
    specimens: SpecimenUncertainty | None = None,
) -> Identification:
    """The expected result of planned tests: the assumed tyre with the uncertainties that the analysis would state.

    Parameters
    ----------
    tests : PlannedTests
    rig : Rig
        The rig as stated, with its uncertainties.
    route : {"mobility", "relative", "transmissibility", "joint"}
        One of `possible_routes`.
    channels : ChannelUncertainty, optional
        Uncertainties of the channels; without it the channels count as exact.
    specimens : SpecimenUncertainty, optional
        Uncertainties of the specimens over blocks and time; without it they do not change. The tests run in the order
        given, and the static test at any time of the run.

    Returns
    -------
    Identification
        The joint route gives one K* for all tests of a family at one frequency; the other routes treat each test by
        itself. Values are not-a-number for rigid blocks.

    Raises
    ------
    ValueError
        If the route is unknown.
    RigError
        If the rig does not allow it.

    Notes
    -----
    The propagation is of first order, for K2 and C of second order. If the uncertainty of K* - K1 exceeds some 30 % of
    K* - K1, the distribution has tails that no standard uncertainty describes.

    Examples
    --------
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0, std={"moving_mass": 0.3, "preload_stiffness": 249.0})
    >>> tests = PlannedTests([10.0, 16.0, 24.0], 110e3, 100e3, 800.0)
    >>> alone, together = (expect(tests, rig, route) for route in ("mobility", "joint"))
    >>> bool(np.all(together.arm_covariance[:, 1, 1] < alone.arm_covariance[:, 1, 1]))
    True
    """
    phasors = planned_phasors(tests, rig)
    stated: dict[str, Any] = {name: getattr(tests, name) for name in ("k1_std", "added_mass", "added_mass_std")}
    if route == "joint":
        specimens = specimens or SpecimenUncertainty()
        place = np.linspace(-0.5, 0.5, len(tests)) if len(tests) > 1 else np.zeros(1)
        drift = specimens.drift.real * np.sqrt(place**2 + 1 / 12) * (len(tests) > 1)
        stated["k1_std"] = np.hypot(tests.k1_std, drift * tests.k1)
        labels = {name: getattr(tests, name).astype(str) for name in ("specimen", "mounting")}
        stated |= {"family": tests.family, "channels": channels, "specimens": specimens, **labels}
        return identify_joint(phasors, rig, tests.k1, **stated)
    phasors.amplitudes[tests.rigid] = np.nan
    return identify(phasors, rig, tests.k1, route=route, channels=channels, **stated)


def relative_uncertainties(expected: Identification) -> FloatArray:
    """Relative standard uncertainties (N, 4) of K*, K2, C and TR; that of K* includes Re and Im."""
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffness = np.sqrt(np.trace(expected.stiffness_covariance, axis1=1, axis2=2)) / np.abs(expected.stiffness)
        arm = np.sqrt(np.diagonal(expected.arm_covariance, 0, 1, 2)) / np.stack([expected.k2, expected.c], axis=1)
        return np.column_stack([stiffness, arm, expected.tr_std / expected.tr_predicted])


def arm_std(tests: PlannedTests, stiffness_covariance: FloatArray | float, k1_std: FloatArray | float) -> FloatArray:
    """Standard uncertainties (N, 2) of K2 and C from those of K* and of K1, which no dynamic test changes.

    Parameters
    ----------
    tests : PlannedTests
    stiffness_covariance : (N, 2, 2) float array [N²/m²]
        Covariance of Re and Im of K*; 0 for the part of K1 alone.
    k1_std : (N,) float array [N/m]
        Standard uncertainty of K1.

    Examples
    --------
    >>> arm_std(PlannedTests(10.0, 110e3, 100e3, 800.0), 0.0, 1e3).round(1).tolist()
    [[2977.3, 16.0]]
    """
    covariance: FloatArray = np.zeros((len(tests), 2, 2)) + stiffness_covariance
    covariance[:, 0, 0] += np.square(k1_std)
    of_arm = arm_covariance(tests.stiffness, tests.k1, 2 * np.pi * tests.frequency, covariance)
    return np.asarray(np.sqrt(np.diagonal(of_arm, 0, 1, 2)))
