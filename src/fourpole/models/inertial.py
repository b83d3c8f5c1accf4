"""Springs of one law about a mass: K* of the springs from what one end, or both, show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import scipy

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.models.data import StiffnessData, multiplication, real_columns, with_shared


class Of(StrEnum):
    """What a table of K* is of."""

    SPRINGS = "springs"
    DRIVING_POINT = "driving point"
    BLOCKED_TRANSFER = "blocked transfer"


@dataclass(frozen=True, eq=False)
class Belt(ByValue):
    """A mass between two springs of one law; see `core.specimen`.

    Attributes
    ----------
    natural : float [rad/s]
        Its angular frequency with both ends held.
    share : float [1]
        Stiffness of the spring at the driven end over that of the other; a tyre's, where a blocked transfer does not
        tell it.
    mass, mass_std : float [kg]
    covariance : (k, k) float array
        Of log `natural` and, for a driving point, of log `share`.
    springs : (N,) complex array [N/m]
        K* of the best relaxing springs.
    """

    natural: float
    share: float
    mass: float
    mass_std: float
    covariance: FloatArray
    springs: ComplexArray


def springs_of(measured: ComplexArray, inertia: FloatArray, share: float | None) -> ComplexArray:
    """K* (N,) of two springs of one law about a mass from what is measured; the inverse of `carried`.

    Of the two roots it is the one nearer to the first value, at the lowest frequency.
    """
    middle = (measured + inertia * (0.0 if share is None else 1 + share)) / 2
    root = np.sqrt(middle**2 - measured * inertia)
    pair = np.stack([middle + root, middle - root])
    return np.asarray(pair[np.argmin(np.abs(pair - measured[0]), axis=0), np.arange(measured.size)])


def carried(stiffness: ComplexArray, inertia: FloatArray, share: float | None) -> tuple[ComplexArray, ComplexArray]:
    r"""What is measured on two springs of one law about a mass, and its slope (N,) by K* (N,) of the springs.

    With :math:`u = \omega^2 m_{12}` (N,) [N/m] and the share r of the spring at the driven end over the other, a
    driving point has :math:`K^* - r u K^*/(K^* - u)`. Without a share it is a blocked transfer, whose K* is
    :math:`K^{*2}/(K^* - u)`.
    """
    rest = stiffness - inertia
    with np.errstate(divide="ignore", invalid="ignore"):
        if share is None:
            return stiffness**2 / rest, stiffness * (rest - inertia) / rest**2
        return stiffness * (1 - share * inertia / rest), 1 + share * inertia**2 / rest**2


def inertia_of(first: complex, omega: FloatArray, belt: Sequence[float]) -> tuple[FloatArray, float | None]:
    """The u (N,) [N/m] of `carried`, and the share, of a belt by its logarithms: frequency [rad/s] and, if any, share.

    The frequency is that of the mass, both ends held, if K* of the springs were the modulus of the `first` value.
    """
    share = float(np.exp(belt[1])) if len(belt) > 1 else None
    return omega**2 * abs(first) / np.exp(2 * belt[0]), share


def turned(
    data: StiffnessData, stiffness: ComplexArray, slope: ComplexArray | None, columns: ComplexArray
) -> StiffnessData:
    """The data of another K* (N,) by its slope (N,) by the measured one, with further errors (N, k) that all share."""
    whole = data.covariance
    if slope is not None:
        turn = multiplication(slope)
        if data.full:
            each = scipy.linalg.block_diag(*turn)
            whole = each @ whole @ each.T
        else:
            whole = turn @ whole @ np.swapaxes(turn, 1, 2)
    whole = with_shared(whole, real_columns(columns), stiffness.shape)
    return replace(data, stiffness=stiffness, covariance=whole, relative=None, reference=None, recorded=None)
