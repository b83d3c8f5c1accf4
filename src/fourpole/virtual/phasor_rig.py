"""The dynamic rig in the frequency domain: many tests at once, as a laboratory would measure their phasors.

The equations of motion of the whole chain are solved at one frequency per test, on small matrices of their own::

    F1, V1 ── input mass ── TYRE (with a belt) ── tyre mass + moving mass + added mass ── leaf spring ── frame ── fixed
                                 └ V2 is measured here

The solution is as exact as in the time domain and a thousand times faster, for validations with thousands of campaigns.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByRows, ByValue, ComplexArray, FloatArray
from fourpole.core.phasor import SYMBOLS, Phasors
from fourpole.core.rig import PARAMETERS

#: The values of a rig that a laboratory states, in the order in which random true values are made.
RIG_VALUES = tuple(PARAMETERS)
#: The channels, in the order of all triples.
CHANNELS = tuple(SYMBOLS.values())
#: Names of the errors of the channels.
FAULTS = tuple(f"{what} {channel}" for what in ("gain", "phase") for channel in CHANNELS)
_UNDECLARED = (*RIG_VALUES, "leaf_friction", *FAULTS)


@dataclass(frozen=True)
class Laboratory:
    """The statement of a laboratory about its rig and sensors, and the errors that it does not know.

    Parameters
    ----------
    moving_mass, preload_stiffness, preload_damping : (value, std) [kg], [N/m], [N s/m]
        m, K3 and c3 with their standard uncertainties.
    preload_loss_factor, tyre_mass, frame_stiffness, input_mass : (value, std) [1], [kg], [N/m], [kg]
        Further parts of the rig with their standard uncertainties; by default absent, with a rigid frame.
    std_gain, std_phase : (F1, V1, V2) [1], [rad]
        Standard uncertainties of the channels' gains (relative) and phases.
    noise : float [1]
        Standard deviation of the noise of Re and of Im of each phasor, relative to its modulus; >= 0.
    std_added : float [1]
        Relative standard uncertainty of each added mass; all tests with that mass share one error.
    undeclared : mapping of str to float
        True values that replace drawn ones: any of the rig's values [SI]; ``leaf_friction`` [N], the Coulomb friction
        between the moving mass and the foundation; ``gain F1`` ... [1] and ``phase F1`` ... [rad], the errors of a
        channel.

    Raises
    ------
    ValueError
        If `undeclared` has an unknown name, or noise is negative.

    Examples
    --------
    >>> Laboratory(moving_mass=(15.0, 0.1), undeclared={"tyre_mass": 0.8}).undeclared["tyre_mass"]
    0.8
    """

    moving_mass: tuple[float, float] = (15.0, 0.01)
    preload_stiffness: tuple[float, float] = (12440.0, 20.0)
    preload_damping: tuple[float, float] = (15.0, 0.5)
    preload_loss_factor: tuple[float, float] = (0.0, 0.0)
    tyre_mass: tuple[float, float] = (0.0, 0.0)
    frame_stiffness: tuple[float, float] = (inf, 0.0)
    input_mass: tuple[float, float] = (0.0, 0.0)
    std_gain: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std_phase: tuple[float, float, float] = (0.0, 0.0, 0.0)
    noise: float = 0.0
    std_added: float = 1e-4
    undeclared: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in self.undeclared:
            if name not in _UNDECLARED:
                raise ValueError(f"undeclared {name!r} is unknown; known are {', '.join(_UNDECLARED)}")
        if not self.noise >= 0.0:
            raise ValueError(f"noise is {self.noise:g}: it must be zero or positive")


@dataclass(frozen=True, eq=False)
class DrawnLaboratory(ByValue):
    """The true values of one laboratory, which all its tests share.

    Parameters
    ----------
    moving_mass, ..., input_mass : float
        True values of the rig, in the units of `Laboratory`.
    leaf_friction : float [N]
        Coulomb friction between the moving mass and the foundation.
    gain, phase : (3,) float arrays [1], [rad]
        Errors of F1, V1, V2: measured = true (1 + gain) e^{j phase}.
    added_mass : mapping of float to float [kg]
        True value of each added mass by its weighed value; 0 is exact.

    Examples
    --------
    >>> draw(Laboratory(std_added=0.0), np.random.default_rng(1), added_masses=[10.0]).added_mass
    {0.0: 0.0, 10.0: 10.0}
    """

    moving_mass: float
    preload_stiffness: float
    preload_damping: float
    preload_loss_factor: float
    tyre_mass: float
    frame_stiffness: float
    input_mass: float
    leaf_friction: float
    gain: FloatArray
    phase: FloatArray
    added_mass: Mapping[float, float]


@dataclass(frozen=True, eq=False)
class Conditions(ByValue):
    """Conditions of N tests: one value per test, or one value for all.

    Parameters
    ----------
    frequency : (N,) float array [Hz]
        Excitation frequency; > 0.
    k1, k2, c : (N,) float arrays [N/m], [N/m], [N s/m]
        Values of the tyre, > 0; a calibration does not use them.
    added_mass : (N,) float array [kg]
        Mass fixed to the moving mass, as weighed; for a calibration, the mass of the rigid block.
    eccentricity : (N,) float array [m]
        Amplitude of the motion of the contact; > 0.
    calibration : (N,) bool array
        True for a rigid block in place of the tyre, so that V1 = V2.
    has_motion_out : (N,) bool array
        Whether V2 is measured.
    stiffness : (N,) complex array [N/m], optional
        K* of the tyre in place of K1, K2 and C, not zero. It may come from any model, causal or not.
    belt_mass : (N,) float array [kg]
        Mass of a belt between two springs that together have this K*; >= 0.
    belt_share : (N,) complex array [1]
        K* of the spring at the contact over that at the rim; not zero.

    Examples
    --------
    >>> Conditions(frequency=[10.0, 24.0], k1=120e3, k2=90e3, c=800.0).spread().k1.tolist()
    [120000.0, 120000.0]
    """

    frequency: ArrayLike
    k1: ArrayLike = 1.0
    k2: ArrayLike = 1.0
    c: ArrayLike = 1.0
    added_mass: ArrayLike = 0.0
    eccentricity: ArrayLike = 1e-3
    calibration: ArrayLike = False
    has_motion_out: ArrayLike = True
    stiffness: ArrayLike | None = None
    belt_mass: ArrayLike = 0.0
    belt_share: ArrayLike = 0.2

    def spread(self) -> _Tests:
        """The conditions with an array of N values for each quantity.

        Raises
        ------
        ValueError
            If the shapes do not agree, or a value is out of its range.
        """
        calibration, has_motion_out = (np.asarray(flag, dtype=bool) for flag in (self.calibration, self.has_motion_out))
        parts = [np.asarray(value, dtype=float) for value in (self.k1, self.k2, self.c)]
        if self.stiffness is not None:  # K1 is K*, and the arm has no damper
            parts = [np.asarray(self.stiffness, dtype=complex), np.ones(()), np.zeros(())]
        tyre = [np.where(calibration, 1.0, part) for part in parts]
        others = (np.asarray(value, dtype=float) for value in (self.added_mass, self.eccentricity, self.belt_mass))
        share = np.asarray(self.belt_share, dtype=complex)
        frequency = np.atleast_1d(np.asarray(self.frequency, dtype=float))
        tests = _Tests(*np.broadcast_arrays(frequency, *tyre, *others, share, calibration, has_motion_out))
        if tests.frequency.ndim != 1:
            raise ValueError(f"conditions have shape {tests.frequency.shape}: one value per test is wanted")
        positive = [tests.frequency, tests.eccentricity]
        if self.stiffness is None:
            positive += [tests.k1.real, tests.k2, tests.c]
        elif not np.all(np.isfinite(tests.k1) & (tests.k1 != 0)):
            raise ValueError("the stiffness must be finite and not zero: a model answers within its band only")
        masses = min(tests.added_mass.min(), tests.belt_mass.min())
        if not (min(values.min() for values in positive) > 0.0 <= masses and np.all(tests.belt_share)):
            raise ValueError("frequency, eccentricity, K1, K2, C and belt_share must be > 0, the masses >= 0")
        return tests


@dataclass(frozen=True, eq=False)
class _Tests(ByRows):
    """Conditions of N tests, one array for each quantity; if K* is given, `k1` has it and is complex."""

    frequency: FloatArray
    k1: FloatArray | ComplexArray
    k2: FloatArray
    c: FloatArray
    added_mass: FloatArray
    eccentricity: FloatArray
    belt_mass: FloatArray
    belt_share: ComplexArray
    calibration: BoolArray
    has_motion_out: BoolArray


@dataclass(frozen=True, eq=False)
class PhasorCampaign(ByValue):
    """N measured tests, and their true values.

    Parameters
    ----------
    phasors : Phasors
        Phasors of N tests with the errors of the channels and noise; V2 is not-a-number if not measured.
    true_amplitudes : (N, 3) complex array [N], [m/s], [m/s]
        True F1, V1, V2.
    stiffness : (N,) complex array [N/m]
        True K* of the tyre; not-a-number for a calibration.
    k2, c : (N,) float arrays [N/m], [N s/m]
        True K2 and C; not-a-number for a calibration, and if the conditions state K* itself.
    transmissibility : (N,) float array [1]
        TR, the modulus of V2/V1.
    truth : DrawnLaboratory
        True values that the tests share.
    """

    phasors: Phasors
    true_amplitudes: ComplexArray
    stiffness: ComplexArray
    k2: FloatArray
    c: FloatArray
    transmissibility: FloatArray
    truth: DrawnLaboratory


def draw(laboratory: Laboratory, rng: np.random.Generator, *, added_masses: Sequence[float] = ()) -> DrawnLaboratory:
    """True values of one laboratory, drawn from normal distributions about its statement.

    `rng` gives the same numbers for every statement, so that laboratories which differ in one value have equal errors.

    Parameters
    ----------
    laboratory : Laboratory
    rng : numpy.random.Generator
    added_masses : sequence of float [kg]
        The added masses as weighed; each has one error.

    Returns
    -------
    DrawnLaboratory

    Examples
    --------
    >>> truth = draw(Laboratory(moving_mass=(15.0, 0.1)), np.random.default_rng(1982))
    >>> 14.5 < truth.moving_mass < 15.5
    True
    """
    hidden = laboratory.undeclared

    def errors(what: str, std: tuple[float, float, float]) -> FloatArray:
        drawn = std * rng.standard_normal(3)
        return np.array(
            [hidden.get(f"{what} {channel}", error) for channel, error in zip(CHANNELS, drawn, strict=True)]
        )

    rig = {}
    for name, deviation in zip(RIG_VALUES, rng.standard_normal(len(RIG_VALUES)), strict=True):
        value, std = getattr(laboratory, name)
        rig[name] = float(hidden.get(name, value + std * deviation))
    gain, phase = errors("gain", laboratory.std_gain), errors("phase", laboratory.std_phase)
    added = {0.0: 0.0}
    for mass in sorted({float(mass) for mass in added_masses} - {0.0}):
        added[mass] = mass * (1.0 + laboratory.std_added * float(rng.standard_normal()))
    friction = float(hidden.get("leaf_friction", 0.0))
    return DrawnLaboratory(leaf_friction=friction, gain=gain, phase=phase, added_mass=added, **rig)


def simulate_phasors(
    laboratory: Laboratory, conditions: Conditions, rng: np.random.Generator, *, truth: DrawnLaboratory | None = None
) -> PhasorCampaign:
    r"""Run all tests of a campaign in one laboratory.

    .. math:: X_{measured} = X\,(1 + \epsilon)\,e^{j\phi} + noise

    The time factor is e^{+jwt}, amplitudes are 0-to-peak. V1 and V2 are positive from the contact towards the
    foundation, and so is a pushing force F1. The cam prescribes V1, which is real and positive.

    Parameters
    ----------
    laboratory : Laboratory
        The statement of the laboratory.
    conditions : Conditions
        Conditions of the N tests.
    rng : numpy.random.Generator
        Source of the true values and, after them, of the noise.
    truth : DrawnLaboratory
        True values in place of drawn ones; they must include every added mass.

    Returns
    -------
    PhasorCampaign

    Raises
    ------
    ValueError
        If a condition is out of its range, or the friction is so large that the mass sticks.

    Notes
    -----
    Coulomb friction F_f is represented by its first harmonic, an impedance of :math:`4 F_f / (\pi |V_2|)` parallel to
    the leaf spring. The motion is nearly a sine if the friction is small against the forces on the mass. The modulus
    of V2 follows in closed form.

    Examples
    --------
    >>> tests = Conditions(frequency=[10.0, 24.0], k1=120e3, k2=90e3, c=800.0)
    >>> run = simulate_phasors(Laboratory(noise=1e-4), tests, np.random.default_rng(1982))
    >>> run.phasors.amplitudes.shape, run.transmissibility.round(1).tolist()
    ((2, 3), [1.4, 1.2])
    """
    tests = conditions.spread()
    if truth is None:
        truth = draw(laboratory, rng, added_masses=np.unique(tests.added_mass).tolist())
    true = _amplitudes(tests, truth)
    measured = true * (1.0 + truth.gain) * np.exp(1j * truth.phase)
    std = laboratory.noise * np.abs(measured)
    measured = measured + std * (rng.standard_normal(true.shape) + 1j * rng.standard_normal(true.shape))
    measured[~tests.has_motion_out, 2] = complex(np.nan, np.nan)
    std[~tests.has_motion_out, 2] = 0.0
    count = tests.frequency.size
    covariance = np.zeros((count, 6, 6))
    covariance[:, range(6), range(6)] = np.repeat(std, 2, axis=1) ** 2
    tyre = np.where(tests.calibration, np.nan, 1.0)
    arm = tyre if conditions.stiffness is None else np.nan
    return PhasorCampaign(
        phasors=Phasors(tests.frequency, measured, covariance, np.zeros(count), np.full(count, inf)),
        true_amplitudes=true,
        stiffness=tyre * _stiffness(tests),
        k2=arm * tests.k2,
        c=arm * tests.c,
        transmissibility=np.abs(true[:, 2] / true[:, 1]),
        truth=truth,
    )


def _amplitudes(tests: _Tests, truth: DrawnLaboratory) -> ComplexArray:
    """True F1, V1, V2 (N, 3)."""
    s = 2j * np.pi * tests.frequency
    x1 = -1j * tests.eccentricity  # this phase makes V1 real
    added = np.array([truth.added_mass[float(mass)] for mass in tests.added_mass])
    mass = truth.moving_mass + added + np.where(tests.calibration, 0.0, truth.tyre_mass)
    leaf = truth.preload_stiffness * (1.0 + 1j * truth.preload_loss_factor) + s * truth.preload_damping
    held = leaf / (1.0 + leaf * (1.0 / truth.frame_stiffness))  # leaf spring and frame in series
    above = np.asarray(s * s * mass + held, dtype=complex)
    rubbing = 4.0 * truth.leaf_friction / np.pi  # first harmonic of the friction [N]
    through = above * x1 + rubbing * 1j * x1 / np.abs(x1)  # with a rigid block
    x2 = x1.copy()
    on = ~tests.calibration
    if on.any():
        through[on], x2[on] = _over_tyres(s[on], tests.part(on), x1[on], above[on], rubbing)
    f1 = through + s * s * truth.input_mass * x1
    return np.stack([f1, s * x1, s * x2], axis=-1)


def _over_tyres(
    s: ComplexArray, tests: _Tests, x1: ComplexArray, above: ComplexArray, rubbing: float
) -> tuple[ComplexArray, ComplexArray]:
    """Force on the tyre [N] and motion x2 of the moving mass [m], for the motion x1 of the contact.

    There are two equations of motion: one for the massless point between K2 and C, or for the belt between its springs,
    and one for the moving mass.
    """
    k1, k2, damper = tests.k1, tests.k2, s * tests.c
    belt = tests.belt_mass > 0.0
    if belt.any():
        contact = _stiffness(tests) * (1.0 + tests.belt_share)
        k1, k2 = np.where(belt, 0.0, k1), np.where(belt, contact, k2)
        damper = np.where(belt, contact / tests.belt_share, damper)
    matrix = np.empty((s.size, 2, 2), dtype=np.complex128)
    matrix[:, 0, 0], matrix[:, 0, 1] = k2 + damper + s * s * tests.belt_mass, -damper
    matrix[:, 1, 0], matrix[:, 1, 1] = -damper, k1 + damper + above
    forces = np.zeros((s.size, 2, 2), dtype=np.complex128)
    forces[:, 0, 0], forces[:, 1, 0] = k2 * x1, k1 * x1  # from the motion of the cam
    forces[:, 1, 1] = -1.0  # a unit of friction, which opposes the motion of the mass
    moved: ComplexArray = np.linalg.solve(matrix, forces)
    inner, x2 = moved[:, 0, 0], moved[:, 1, 0]
    if rubbing:
        friction = _friction(x2, moved[:, 1, 1], rubbing)
        inner, x2 = inner + moved[:, 0, 1] * friction, x2 + moved[:, 1, 1] * friction
    return k1 * (x1 - x2) + k2 * (x1 - inner), x2


def _friction(free: ComplexArray, per_force: ComplexArray, rubbing: float) -> ComplexArray:
    r"""Friction j g x2/|x2| on a mass with motion `free` without friction, and h = `per_force` more per newton.

    With x2 = A u, A > 0, \|u\| = 1, the motion is (A - j g h) u = free. Then \|A - j g h\| = \|free\| is a quadratic
    equation for A.
    """
    turned = 1j * rubbing * per_force
    room = np.abs(free) ** 2 - turned.imag**2
    amplitude = turned.real + np.sqrt(np.maximum(room, 0.0))
    if not (np.all(room > 0.0) and np.all(amplitude > 0.0)):
        raise ValueError(f"leaf_friction of {rubbing * np.pi / 4.0:g} N holds the mass: it does not move at all")
    return np.asarray(1j * rubbing * free / (amplitude - turned), dtype=np.complex128)


def _stiffness(tests: _Tests) -> ComplexArray:
    """K* (N,) [N/m]: force per motion of the contact with a fixed far side."""
    damper = 2j * np.pi * tests.frequency * tests.c
    inner = tests.k2 / (tests.k2 + damper)
    return np.asarray(tests.k1 + damper * inner, dtype=np.complex128)
