"""A model in the place of the tyre on a rig: its four-pole, mobility, transmissibility and state space."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core import tyre
from fourpole.core.arrays import ComplexArray
from fourpole.core.rig import Rig
from fourpole.core.twoport import spring
from fourpole.errors import ModelError
from fourpole.models.fractional import rational
from fourpole.models.interface import Model, StateSpace, positive


def four_pole(model: Model, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
    r"""Four-pole of a model: a massless spring of its K*.

    .. math:: \begin{bmatrix} 1 & 0 \\ j\omega/K^* & 1 \end{bmatrix}

    Parameters
    ----------
    model : Model
    values : (..., P) float array
        Parameters of the model.
    omega : (N,) or (..., N) float array [rad/s]
        Angular frequencies, > 0.

    Returns
    -------
    (..., N, 2, 2) complex array
        Matrices for `fourpole.twoport.cascade`, with the units 1, N s/m, m/(N s), 1.

    Raises
    ------
    ModelError
        If K* is zero, or a frequency is outside the band of a table.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (4) and (5).

    Examples
    --------
    >>> from fourpole.models.springs import KelvinVoigt
    >>> four_pole(KelvinVoigt(), [180e3, 700.0], [60.0])[0, 1, 0].round(8)
    np.complex128(7.376e-05+0.00031612j)
    """
    return spring(_stiffness(model, values, omega), positive(omega))


def mobility(model: Model, values: ArrayLike, rig: Rig, omega: ArrayLike, added_mass: ArrayLike = 0.0) -> ComplexArray:
    r"""Mobility V1/F1 = R + jI of a model on a rig, at the force cell.

    .. math:: \frac{1}{M} = j\omega m_1 + \Bigl(\frac{j\omega}{K^*} + \frac{1}{Z_r}\Bigr)^{-1}

    Parameters
    ----------
    model, values, omega
        As in `four_pole`.
    rig : Rig
        The rig, with the input mass m1 and the impedance Zr beyond the tyre; Zr is infinite if the output is blocked.
    added_mass : float or array that broadcasts with (..., N) [kg]
        Mass added to the moving mass.

    Returns
    -------
    (..., N) complex array [m/(N s)]

    Raises
    ------
    ModelError
        As `four_pole`.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (1), (8).

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    >>> mobility(Zener(), [180e3, 120e3, 700.0], rig, [20 * np.pi]).round(8)
    array([6.211e-05-0.00103208j])
    """
    jw = 1j * positive(omega)
    contact = jw / _stiffness(model, values, omega) + rig.mobility(jw.imag, added_mass)
    return np.asarray(1.0 / (1.0 / contact + jw * rig.input_mass))


def transmissibility(
    model: Model, values: ArrayLike, rig: Rig, omega: ArrayLike, added_mass: ArrayLike = 0.0
) -> ComplexArray:
    r"""Motion transmissibility V2/V1 of a model on a rig; its modulus is the paper's TR.

    .. math:: T = \frac{K^*}{K^* + j\omega Z_r}

    Parameters
    ----------
    model, values, rig, omega, added_mass
        As in `mobility`.

    Returns
    -------
    (..., N) complex array [1]
        V2/V1; 0 if the output is blocked.

    Raises
    ------
    ModelError
        As `four_pole`.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (5)-(7), (14).

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    >>> abs(transmissibility(Zener(), [180e3, 120e3, 700.0], rig, [20 * np.pi])).round(4)
    array([1.2991])
    """
    stiffness, omega = _stiffness(model, values, omega), positive(omega)
    if rig.blocked:
        return np.zeros(np.broadcast_shapes(stiffness.shape, np.shape(added_mass)), dtype=complex)
    whole = 1j * omega * rig.impedance(omega, added_mass)  # the rig beyond the tyre as one complex spring
    return tyre.transmissibility(stiffness, omega, mass=0.0, preload_stiffness=whole)


def in_time(model: Model, values: ArrayLike, band: tuple[float, float], accuracy: float = 1e-6) -> StateSpace:
    """The state space of a model, or of the Maxwell arms that approximate it within a band.

    Parameters
    ----------
    model : Model
        A causal model.
    values : (P,) float array
        Parameters of the model.
    band : (float, float) [Hz]
        Band of the approximation, for a model without a state space of finite order.
    accuracy : float [1]
        Largest relative error of K* within the band.

    Returns
    -------
    StateSpace

    Raises
    ------
    ModelError
        If the model is not causal, or 60 arms have a larger error.

    Examples
    --------
    >>> from fourpole.models.fractional import FractionalZener
    >>> values = [150e3, 400e3, 2e-3, 0.4]
    >>> space = in_time(FractionalZener(), values, (5.0, 50.0))
    >>> bool(abs(space.stiffness(100.0) / FractionalZener().stiffness(values, 100.0)[0] - 1) < 1e-6)
    True
    """
    model.checked(values)
    if not model.causal:
        raise ModelError(
            f"the {model.name} model is not causal and cannot be simulated in time: take zener, kelvin or maxwell:N, "
            "or compute its response over frequency"
        )
    try:
        return model.state_space(values)
    except ModelError:  # the fractional models have a power of frequency
        maxwell, arms, _ = rational(model, values, band, accuracy)
        return maxwell.state_space(arms)


def _stiffness(model: Model, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
    """K* [N/m]; ModelError if it is zero."""
    stiffness = model.stiffness(values, omega)
    if not np.all(stiffness):
        raise ModelError(f"K* of the {model.name} model is zero for these values: state a positive stiffness")
    return stiffness
