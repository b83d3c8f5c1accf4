"""Reduced tables: K*, K2, C and TR from a frequency and a mobility or K* per row, as in the paper's program."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.identify import identify, variance_by_source
from fourpole.core.phasor import Phasors
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.routes import maxwell_arm, mobility_route, paper_d, transmissibility_route, why_no_arm
from fourpole.core.sources import Source
from fourpole.core.tyre import loss_factor, zener_stiffness


@dataclass(frozen=True, eq=False)
class ReducedResult(ByValue):
    """Tyre properties of each row; a value that does not exist is not-a-number.

    Attributes
    ----------
    frequency : (N,) float [Hz]
    mobility : (N,) complex [m/(N s)]
        R + jI of tyre and rig together.
    d : (N,) float [1]
        The paper's d.
    stiffness : (N,) complex [N/m]
        K* of the tyre.
    loss_factor : (N,) float [1]
    k2, c : (N,) float [N/m], [N s/m]
    tr : (N,) float [1]
        abs(V2/V1) from K* and the rig; not-a-number without a rig.
    reasons : tuple of N str
        Reason why K2 and C are blank; empty if they are not.
    """

    frequency: FloatArray
    mobility: ComplexArray
    d: FloatArray
    stiffness: ComplexArray
    loss_factor: FloatArray
    k2: FloatArray
    c: FloatArray
    tr: FloatArray
    reasons: tuple[str, ...]


def identify_mobility(
    frequency: ArrayLike, mobility: ArrayLike, k1: ArrayLike, rig: Rig | None = None
) -> ReducedResult:
    """K*, K2, C and TR from measured mobilities.

    Parameters
    ----------
    frequency : (N,) float array [Hz]
        Excitation frequencies.
    mobility : (N,) complex array [m/(N s)]
        V1/F1 = R + jI of tyre and rig.
    k1 : (N,) float array [N/m]
        Static stiffness.
    rig : Rig, optional
        The rig to remove; without it, the far side of the specimen does not move.

    Returns
    -------
    ReducedResult
        One row per frequency.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (9)-(14) and section 3.3.

    Examples
    --------
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    >>> found = identify_mobility([10.0], [6.2114469491190663e-5 - 0.001032080825614907j], 180e3, rig)
    >>> [one.round(6).tolist() for one in (found.k2, found.c, found.tr)]
    [[120000.0], [700.0], [1.299101]]
    """
    frequency, omega = _turning(frequency)
    mobility = np.atleast_1d(np.asarray(mobility, dtype=complex))
    with np.errstate(divide="ignore", invalid="ignore"):
        beyond = rig.mobility(omega) if rig is not None else np.zeros_like(mobility)
        contact = 1.0 / (1.0 / mobility - _input_impedance(omega, rig))
        return _result(frequency, mobility, mobility_route(contact, beyond, omega), k1, rig)


def identify_stiffness(
    frequency: ArrayLike, stiffness: ArrayLike, k1: ArrayLike, rig: Rig | None = None
) -> ReducedResult:
    """K2, C and, on a rig, R, I and TR from known dynamic stiffnesses of the tyre itself.

    Parameters
    ----------
    frequency : (N,) float array [Hz]
        Excitation frequencies.
    stiffness : (N,) complex array [N/m]
        K* of the tyre alone.
    k1 : (N,) float array [N/m]
        Static stiffness.
    rig : Rig, optional
        The rig for which R, I and TR are computed.

    Returns
    -------
    ReducedResult
        One row per frequency.

    Examples
    --------
    >>> identify_stiffness([10.0], [194211.26530917299 + 38773.596369347214j], 180e3).k2.round(3).tolist()
    [120000.0]
    """
    frequency, omega = _turning(frequency)
    stiffness = np.atleast_1d(np.asarray(stiffness, dtype=complex))
    with np.errstate(divide="ignore", invalid="ignore"):
        beyond = rig.mobility(omega) if rig is not None else np.zeros_like(stiffness)
        contact = 1j * omega / stiffness + beyond
        return _result(frequency, 1.0 / (1.0 / contact + _input_impedance(omega, rig)), stiffness, k1, rig)


def identify_transmissibility(
    frequency: ArrayLike, transmissibility: ArrayLike, k1: ArrayLike, rig: Rig
) -> ReducedResult:
    r"""K*, K2, C and TR from measured complex transmissibilities of a specimen on a rig.

    .. math:: K^* = j\omega Z_r \frac{T}{1 - T}

    Parameters
    ----------
    frequency : (N,) float array [Hz]
        Excitation frequencies.
    transmissibility : (N,) complex array [1]
        T = V2/V1.
    k1 : (N,) float array [N/m]
        Static stiffness.
    rig : Rig
        The rig beyond the specimen.

    Returns
    -------
    ReducedResult
        One row per frequency.

    Examples
    --------
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=0.0)
    >>> identify_transmissibility([10.0], [1.5 - 0.05j], 180e3, rig).stiffness.round(1)
    array([176480.3+11726.3j])
    """
    frequency, omega = _turning(frequency)
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffness = transmissibility_route(transmissibility, rig.impedance(omega), omega)
    return identify_stiffness(frequency, stiffness, k1, rig)


def predict(frequency: ArrayLike, k1: float, k2: float, c: float, rig: Rig) -> ReducedResult:
    """R, I, K* and TR of a tyre of constant K1, K2 and C on a rig.

    Parameters
    ----------
    frequency : (N,) float array [Hz]
        Frequencies, > 0.
    k1, k2 : float [N/m]
        Static stiffness, and the spring of the arm; > 0.
    c : float [N s/m]
        The damper of the arm; > 0.
    rig : Rig
        The rig.

    Returns
    -------
    ReducedResult
        One row per frequency.

    Examples
    --------
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    >>> predict([10.0], 180e3, 120e3, 700.0, rig).tr.round(6)
    array([1.299101])
    """
    _, omega = _turning(frequency)
    return identify_stiffness(frequency, zener_stiffness(k1, k2, c, omega), k1, rig)


def stiffness_std(result: ReducedResult, relative: ArrayLike, rig: Rig | None = None) -> FloatArray:
    r"""Standard uncertainty of Re K* and of Im K* [N/m] from that of a mobility V1/F1, the same in all directions.

    .. math:: u(K^*) = \frac{|K^*|^2}{\omega} \frac{|Y_1|^2}{|Y|} u_r(Y)

    Parameters
    ----------
    result : ReducedResult
        What `identify_mobility` returns.
    relative : (N,) float array [1]
        Relative standard uncertainty of the mobility Y, the same in all directions.
    rig : Rig, optional
        The rig that was removed; exact here. Y_1 is the mobility without its input mass.

    Examples
    --------
    >>> result = identify_mobility([10.0], [1e-3j], 180e3)
    >>> float((stiffness_std(result, [0.01]) / abs(result.stiffness)).round(6)[0])
    0.01
    """
    _, omega = _turning(result.frequency)
    with np.errstate(divide="ignore", invalid="ignore"):
        contact = 1.0 / (1.0 / result.mobility - _input_impedance(omega, rig))
        gain = np.abs(result.stiffness) ** 2 / omega * np.abs(contact) ** 2 / np.abs(result.mobility)
    return np.asarray(gain * np.asarray(relative, dtype=float))


@dataclass(frozen=True, eq=False)
class ReducedUncertainty(ByValue):
    """Standard uncertainties of each row; not-a-number for a value that does not exist.

    Attributes
    ----------
    storage, loss, k2, c : (N,) float [N/m], [N s/m]
        Of Re K*, Im K*, K2 and C.
    of_c : dict of Source to (N,) float [1]
        Standard uncertainty of C over C from each source alone.
    """

    storage: FloatArray
    loss: FloatArray
    k2: FloatArray
    c: FloatArray
    of_c: dict[Source, FloatArray]

    def most_of_c(self) -> tuple[Source, int, float] | None:
        """The source that moves C most, with the row and the ratio [1]; None if no row has a C."""
        found = [
            (source, int(np.nanargmax(r)), float(np.nanmax(r))) for source, r in self.of_c.items() if np.any(r > 0)
        ]
        return max(found, key=lambda one: one[2], default=None)


def reduced_uncertainty(
    result: ReducedResult,
    k1: float,
    rig: Rig | None = None,
    *,
    noise: ArrayLike = 0.0,
    rig_std: float = 0.0,
    gain_std: float = 0.0,
    phase_std: float = 0.0,
    k1_std: float = 0.0,
    transmissibility: ArrayLike | None = None,
) -> ReducedUncertainty:
    """Standard uncertainties of K*, K2 and C from those of rig, force, motion and K1, by `core.identify.identify`.

    Parameters
    ----------
    result : ReducedResult
        The rows.
    k1 : float [N/m]
        Static stiffness; not-a-number if it is not known.
    rig : Rig, optional
        The rig that was removed; without it K* is a force over a deflection.
    noise : (N,) float array [1]
        Relative standard uncertainty of the ratio of motion and force in each row, the same in all directions.
    rig_std, gain_std, k1_std : float [1]
        Relative standard uncertainties of each value of the rig, of both gains, and of K1.
    phase_std : float [rad]
        Standard uncertainty of both phases.
    transmissibility : (N,) complex array, optional [1]
        V2/V1 from which the rows came, in place of force and motion.

    Examples
    --------
    One per cent of the moving mass alone:

    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    >>> result = identify_mobility([10.0], [6.2114469e-5 - 1.0320808256e-3j], 180e3, rig)
    >>> float((reduced_uncertainty(result, 180e3, rig, rig_std=0.01).c / result.c).round(3)[0])
    0.259
    """
    rows = np.flatnonzero(np.isfinite(result.stiffness) & (result.frequency > 0))
    frequency, count = result.frequency[rows], result.frequency.size
    whole = np.full((4, count), np.nan)
    if not rows.size:
        return ReducedUncertainty(whole[0], whole[1], whole[2], whole[3], {})
    above = Rig(blocked=True)
    mobility: ComplexArray = 2j * np.pi * frequency / result.stiffness[rows]
    if rig is not None:
        values = {name: rig_std * getattr(rig, name) for name in PARAMETERS if np.isfinite(getattr(rig, name))}
        above, mobility = replace(rig, std=values), result.mobility[rows]
    covariance = np.zeros((rows.size, 6, 6))
    own = np.broadcast_to(np.asarray(noise, dtype=float), count)[rows] * np.abs(mobility)
    covariance[:, 2, 2] = covariance[:, 3, 3] = own**2
    amplitudes = np.stack([np.ones(rows.size), mobility, np.full(rows.size, np.nan)], axis=1)
    used, route = np.array([1.0, 1.0, 0.0]), "mobility"
    if transmissibility is not None:
        ratio = np.asarray(transmissibility, dtype=complex)[rows]
        amplitudes = np.stack([np.full(rows.size, np.nan), np.ones(rows.size), ratio], axis=1)
        covariance[:, 4, 4] = covariance[:, 5, 5] = np.square(np.broadcast_to(noise, count)[rows] * np.abs(ratio))
        covariance[:, 2, 2] = covariance[:, 3, 3] = 0.0
        used, route = np.array([0.0, 1.0, 1.0]), "transmissibility"
    phasors = Phasors(frequency, amplitudes, covariance, np.zeros(rows.size), np.full(rows.size, np.inf))
    channels = ChannelUncertainty(gain_std * used, phase_std * used)
    stated: dict[str, Any] = {"k1": k1, "k1_std": k1_std * abs(k1), "channels": channels, "route": route}
    found = identify(phasors, above, **stated)
    for place, matrix in ((0, found.stiffness_covariance), (2, found.arm_covariance)):
        whole[place : place + 2, rows] = np.sqrt(np.diagonal(matrix, 0, 1, 2)).T
    by_source = {}
    for source, variance in variance_by_source(phasors, above, **stated).items():
        by_source[source] = np.full(count, np.nan)
        by_source[source][rows] = np.sqrt(variance[:, 4]) / result.c[rows]
    return ReducedUncertainty(whole[0], whole[1], whole[2], whole[3], by_source)


def coherence_std(coherence: ArrayLike, averages: float) -> FloatArray:
    r"""Relative standard uncertainty of a frequency response that H1 gives, of its modulus and, in rad, of its phase.

    .. math:: u = \sqrt{(1 - \gamma^2) / (2 n \gamma^2)}

    Parameters
    ----------
    coherence : (...,) float array [1]
        Coherence γ² of input and output, 0 to 1.
    averages : float [1]
        Number n of independent averages, at least 1.

    Returns
    -------
    (...,) float array [1]
        Infinite where the coherence is 0.

    Raises
    ------
    ValueError
        If there is less than one average.

    Notes
    -----
    This is the random error. It holds no errors of gains, and no bias of noise at the input.

    References
    ----------
    J. S. Bendat, A. G. Piersol, "Random Data", 4th edition, 2010, table 9.6.

    Examples
    --------
    >>> coherence_std([0.99, 0.5], 50).round(4)
    array([0.0101, 0.1   ])
    """
    coherence = np.asarray(coherence, dtype=float)
    if not averages >= 1:
        raise ValueError("the coherence has at least one average")
    with np.errstate(divide="ignore"):
        return np.asarray(np.sqrt((1.0 - coherence) / (2.0 * averages * coherence)))


def _input_impedance(omega: FloatArray, rig: Rig | None) -> ComplexArray:
    """Impedance of the mass between force cell and contact [N s/m]."""
    return 1j * omega * (rig.input_mass if rig is not None else 0.0)


def _turning(frequency: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Frequencies as an array [Hz], and their angular frequencies [rad/s]."""
    array = np.atleast_1d(np.asarray(frequency, dtype=float))
    return array, 2 * np.pi * array


def _result(
    frequency: FloatArray, mobility: ComplexArray, stiffness: ComplexArray, k1: ArrayLike, rig: Rig | None
) -> ReducedResult:
    omega = 2 * np.pi * frequency
    k1 = np.broadcast_to(np.asarray(k1, dtype=float), omega.shape)
    k2, c = maxwell_arm(stiffness, k1, omega)
    reasons = tuple(why_no_arm(*row) for row in zip(stiffness, k1, k2, c, strict=True))
    passive = np.array([not reason for reason in reasons], dtype=bool)
    tr = np.full(omega.shape, np.nan)
    if rig is not None and not rig.blocked:
        tr = np.abs(stiffness / (stiffness + 1j * omega * rig.impedance(omega)))
    return ReducedResult(
        frequency=frequency,
        mobility=mobility,
        d=paper_d(stiffness, k1),
        stiffness=stiffness,
        loss_factor=loss_factor(stiffness),
        k2=np.where(passive, k2, np.nan),
        c=np.where(passive, c, np.nan),
        tr=tr,
        reasons=reasons,
    )
