"""Reduced tables: K*, K2, C and TR from a frequency and a mobility or K* per row, as in the paper's program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.rig import Rig
from fourpole.core.routes import maxwell_arm, mobility_route, paper_d, why_no_arm
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
