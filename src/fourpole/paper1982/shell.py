"""Tielking's tyre model: an inflated cylindrical shell on radial springs, loaded on a patch, with a fixed rim."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model, Parameter, StateSpace, columns, positive
from fourpole.paper1982.cylinder import (
    Cylinder,
    elasticity,
    harmonics,
    load,
    modes,
    radial_answer,
    shares,
    slopes,
    wave,
)

#: Number of times that uu, uv, uw, vv, vw and ww occur in a symmetric 3 x 3 matrix; their rows and columns.
_TWICE = np.array([1.0, 2.0, 2.0, 1.0, 2.0, 1.0])
_ROW, _COLUMN = np.array([0, 0, 0, 1, 1, 2]), np.array([0, 1, 2, 1, 2, 2])
#: Modes with less than this fraction of the static deflection are not part of the state space.
_NOT_EXCITED = 1e-16
#: Angular frequency [rad/s] used as zero; the relative change of K* by inertia is below 1e-16 there.
_ZERO = 1e-6

#: R, B, S, D, p, k, mu, tau, l, beta of an illustrative radial-ply tyre of a small car; no value was measured. Size and
#: pressure are typical. The mass of belt and tread is 3 kg; EI = D B is 1 N m² and EA = S B is 1 MN, as usual for ring
#: models of tyres. With these springs the first vertical mode, at a fixed rim, is near 80 Hz.
RADIAL_PLY = (0.28, 0.11, 1e7, 10.0, 150e3, 8e6, 16.0, 6e-4, 0.06, 0.8)

#: The same values of a cross-ply tyre: smaller membrane stiffness, as it has no belt; thicker wall, stiffer sidewalls,
#: with the first mode near 90 Hz, and a larger loss factor.
CROSS_PLY = (0.28, 0.11, 1.5e6, 30.0, 150e3, 1e7, 14.0, 1e-3, 0.06, 0.8)

_PARAMETERS = (
    Parameter("R", "m", 0.05, 0.8, RADIAL_PLY[0], "radius", log=True),
    Parameter("B", "m", 0.01, 2.0, RADIAL_PLY[1], "width", log=True),
    Parameter("S", "N/m", 4e5, np.inf, RADIAL_PLY[2], "membrane stiffness", log=True),
    Parameter("D", "N m", 0.0, np.inf, RADIAL_PLY[3], "bending stiffness", log=True),
    Parameter("p", "Pa", 0.0, 5e5, RADIAL_PLY[4], "inflation pressure", log=True),
    Parameter("k", "N/m^3", 1.0, np.inf, RADIAL_PLY[5], "radial springs", log=True),
    Parameter("mu", "kg/m^2", 1e-3, np.inf, RADIAL_PLY[6], "mass per area", log=True),
    Parameter("tau", "s", 0.0, np.inf, RADIAL_PLY[7], "loss factor over angular frequency", log=True),
    Parameter("l", "m", 0.0, 1.0, RADIAL_PLY[8], "length of the patch"),
    Parameter("beta", "1", 0.0, 1.0, RADIAL_PLY[9], "width of the patch over B"),
)


@dataclass(frozen=True, eq=False)
class _Patch:
    """Harmonics n, m (pairs,) under the patch, and the three results (..., pairs) of `cylinder.load`."""

    n: FloatArray
    m: FloatArray
    around: FloatArray
    across: FloatArray
    per_area: FloatArray

    @property
    def weight(self) -> FloatArray:
        """Weight of each harmonic in the mean deflection (..., pairs) [1/m²]."""
        return np.asarray((self.around * self.across) ** 2 * self.per_area)

    def slopes(self, values: FloatArray) -> FloatArray:
        """Derivatives (..., pairs, 4) of the weight by R, B, l and beta."""
        radius, width = values[..., 0, None], values[..., 1, None]
        length, share = values[..., 8, None], values[..., 9, None]
        along = 2 * self.around * _sinc_slope(self.n * length / (2 * radius)) * self.across**2 * self.per_area
        over = 2 * self.across * _sinc_slope(np.pi * self.m * share / 2) * self.around**2 * self.per_area
        by_length = along * self.n / (2 * radius)
        by_radius = -self.weight / radius - by_length * length / radius
        return np.stack([by_radius, -self.weight / width, by_length, over * np.pi * self.m / 2], axis=-1)


class Shell(Model):
    r"""Driving-point stiffness of a cylindrical shell on radial springs, under a patch, with a fixed rim.

    .. math:: \frac{1}{K^*} = \sum_i \frac{\phi_i^2}{\kappa_i (1 + j\omega\tau) - \mu\omega^2}
              + \frac{H_\mathrm{rest}}{1 + j\omega\tau}

    The sum is over the modes i of the lowest harmonics, radial and in-plane, with stiffness kappa_i per area and mean
    deflection phi_i under the patch. The other harmonics, up to `around` and `across`, have no inertia; their
    flexibility is H_rest. The load is uniform over the patch, and the deflection is its mean. `stiffness` and
    `state_space` are this same truncated sum. `fourpole.paper1982.cylinder` has the theory and its sources;
    `cylinder.enough_terms` gives the numbers of harmonics for an accuracy.

    All elastic terms, including the tension, have the loss factor omega tau. So the model is causal, and its poles are
    stable if tau > 0. It is passive, Im K* >= 0 at every frequency, because every kappa_i is positive: the bounds keep
    S above p R, so that the shell does not buckle.

    The assumptions are a uniform and isotropic wall, small deflections from the inflated cylinder, a constant pressure,
    and no tangential springs.

    Parameters
    ----------
    edges : "guided" or "supported"
        As in `Cylinder`; with guided edges and beta = 1 the shell is a ring.
    poisson : float [1]
        Poisson's ratio, in [0, 0.5].
    axial : float [1]
        N_y/(p R), >= 0.5, so that it carries the pressure on the ends.
    around, across : int
        Numbers of harmonics of the static deflection.
    moving : (int, int)
        Numbers of harmonics around and across that have inertia. With the defaults the relative truncation error of K*
        of `RADIAL_PLY` and `CROSS_PLY` is 1e-5 at 50 Hz and 4e-4 at 300 Hz.

    Raises
    ------
    ModelError
        If a value is outside its bounds, or all harmonics around have inertia.

    References
    ----------
    J. T. Tielking, "Plane vibration characteristics of a pneumatic tire model", SAE 650492, 1965.

    Examples
    --------
    >>> tyre = Shell()
    >>> tyre.stiffness(RADIAL_PLY, [2 * np.pi * 15.0]).round(-1).tolist()
    [(181580+10440j)]
    """

    name = "shell"
    parameters = _PARAMETERS
    usually_fixed = ("R", "B", "S", "D", "p", "l", "beta")
    relaxing = False
    has_inertia = True

    def __init__(
        self,
        edges: Literal["guided", "supported"] = "guided",
        *,
        poisson: float = 0.3,
        axial: float = 0.5,
        around: int = 40,
        across: int = 10,
        moving: tuple[int, int] = (20, 2),
    ) -> None:
        if axial < 0.5:
            raise ModelError(
                f"the axial tension carries the end pressure: it must be at least 0.5 p R, not {axial:g} p R"
            )
        if not (1 <= moving[0] < around and 1 <= moving[1] <= across):
            raise ModelError(
                f"{moving[0]} x {moving[1]} of {around} x {across} harmonics cannot have inertia: state at least "
                f"1 x 1, and fewer than {around} around"
            )
        self.edges, self.poisson, self.axial = edges, poisson, axial
        self.around, self.across, self.moving = around, across, moving
        self._n, self._m = harmonics(edges, around, across)
        first = np.unique(self._m)[moving[1] - 1]
        self._moves = (self._n < moving[0]) & (self._m <= first)
        self.cylinder(self.defaults)

    def cylinder(self, values: ArrayLike) -> Cylinder:
        """The cylinder of parameters (..., P)."""
        radius, width, membrane, bending, pressure, foundation, mass = np.moveaxis(self.checked(values), -1, 0)[:7]
        return Cylinder(
            radius, width, membrane, bending, pressure, foundation, mass, self.poisson, self.axial, self.edges
        )

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        return np.asarray(1.0 / _Moving.of(self, self.checked(values), positive(omega)).receptance)

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives by R, B, S, D, p, k, mu, tau, l and beta."""
        sets, w = self.checked(values), positive(omega)
        moving = _Moving.of(self, sets, w)
        loss, answer, patch = moving.loss[..., None], moving.answer, moving.patch
        by_stiffness = self._by_stiffness(sets, self._n[self._moves], self._m[self._moves])
        weight = patch.weight[..., None, None]
        squares = np.swapaxes(weight * answer[..., _ROW] * answer[..., _COLUMN], -2, -3)
        still, still_of_load = self._rest_slopes(sets)
        change = -loss * _contracted(squares, by_stiffness) + still[..., None, :] / loss
        change_of_load = np.swapaxes(answer[..., 2], -1, -2) @ patch.slopes(sets) + still_of_load[..., None, :] / loss
        rubber = [moving.by_mass[..., None], moving.by_tau[..., None]]
        whole = np.concatenate([change, *rubber, change_of_load[..., 2:]], axis=-1)
        whole[..., :2] += change_of_load[..., :2]
        return np.asarray(-whole / moving.receptance[..., None] ** 2)

    def static_stiffness(self, values: ArrayLike) -> FloatArray:
        """K* at zero frequency."""
        sets = self.checked(values)
        elastic, patch = self._wall(sets, np.ones(self._n.shape, dtype=bool))
        return np.asarray(1.0 / np.sum(patch.weight * radial_answer(elastic)[2], axis=-1))

    def static_derivative(self, values: ArrayLike) -> FloatArray:
        """Derivatives (..., P) of the static stiffness, the limit of `derivative` at zero frequency."""
        return np.asarray(self.derivative(values, [_ZERO])[..., 0, :].real)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:  # noqa: ARG002
        """The default shell with k from the mean K' and tau from the mean loss factor."""
        k = data.stiffness
        found = np.repeat(self.defaults[None], len(k), axis=0)
        for _ in range(4):  # K* is about proportional to k^(3/4)
            found[:, self.symbols.index("k")] *= (np.mean(k.real, axis=1) / self.static_stiffness(found)) ** 1.3
        found[:, self.symbols.index("tau")] = np.mean(k.imag / k.real / data.omega, axis=1)
        return found[None]

    def state_space(self, values: ArrayLike) -> StateSpace:
        """State space with two states, deflection and rate, for each mode that the load excites.

        The force is f + tau df/dt with f = (x - sum phi_i q_i)/H_rest.
        """
        sets = self.checked(values)
        if sets.ndim != 1:
            raise ModelError("the state space of the shell model is for one set of parameters")
        springs, shape, patch, rest = self.parts(sets)
        gain = (shape[..., 2, :] * np.sqrt(patch.weight)[:, None]).ravel()
        kappa = springs.ravel()
        share = gain**2 / kappa
        excited = share > _NOT_EXCITED * share.sum()
        kappa, gain = kappa[excited] / sets[6], gain[excited]
        size, tau = gain.size, sets[7]
        output = -np.concatenate([gain, tau * gain]) / rest
        direct = np.array([1.0, tau]) / rest
        push = np.concatenate([np.zeros(size), gain / sets[6]])
        system = np.outer(push, output)
        at = np.arange(size)
        system[at, size + at] += 1.0
        system[size + at, at] -= kappa
        system[size + at, size + at] -= tau * kappa
        return StateSpace(system, np.outer(push, direct), output, direct)

    def parts(self, sets: FloatArray) -> tuple[FloatArray, FloatArray, _Patch, FloatArray]:
        """Stiffness and shape of the modes with inertia, their patch, and the flexibility of the others [m/N]."""
        moves = self._moves
        elastic, patch = self._wall(sets, moves)
        springs, shape = modes(elastic)
        elastic, others = self._wall(sets, ~moves)
        rest = np.sum(others.weight * radial_answer(elastic)[2], axis=-1)
        return springs, shape, patch, np.asarray(rest)

    def _wall(self, sets: FloatArray, chosen: np.ndarray) -> tuple[FloatArray, _Patch]:
        """Stiffness per area (6, ..., pairs) in the chosen harmonics, and the patch."""
        wall, n, m = self.cylinder(sets), self._n[chosen], self._m[chosen]
        return elasticity(wall, n, m), _Patch(n, m, *load(wall, n, m, sets[..., 8], sets[..., 9]))

    def _by_stiffness(self, sets: FloatArray, n: FloatArray, m: FloatArray) -> FloatArray:
        """Derivatives (..., pairs, 6, 6) of the stiffness per area by R, B, S, D, p and k, times `_TWICE`."""
        cylinder = self.cylinder(sets)
        radius, width, membrane, bending, pressure, *_ = columns(sets)
        across = wave(cylinder, m)
        stretch, bend, tension = shares(cylinder, n, across)
        scales = (membrane / radius**2, bending / radius**4, pressure / radius)
        by_wave = sum(scale * part for scale, part in zip(scales, slopes(cylinder, n, across), strict=True)) * across
        by_size = 2 * scales[0] * stretch + 4 * scales[1] * bend + scales[2] * tension
        unit = np.zeros_like(stretch)
        unit[5] = 1.0
        of_size = [(by_wave - by_size) / radius, -by_wave / width]
        whole = np.stack([*of_size, stretch / radius**2, bend / radius**4, tension / radius, unit])
        return np.moveaxis(whole * _TWICE.reshape(-1, *[1] * (whole.ndim - 2)), (1, 0), (-2, -1))

    def _rest_slopes(self, sets: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of H_rest: by R, B, S, D, p, k of the shell, and by R, B, l, beta of the load."""
        elastic, patch = self._wall(sets, ~self._moves)
        answer = radial_answer(elastic)
        squares = np.moveaxis(patch.weight * answer[_ROW] * answer[_COLUMN], 0, -1)[..., None, :, :]
        shell = -_contracted(squares, self._by_stiffness(sets, patch.n, patch.m))[..., 0, :]
        return shell, (answer[2][..., None, :] @ patch.slopes(sets))[..., 0, :]


@dataclass(frozen=True, eq=False)
class _Moving:
    """The shell under a unit load at frequencies (N,).

    `loss` is the complex factor (..., N) of the stiffness of the wall; `answer` are the deflections (..., pairs, N, 3)
    of the modes with inertia, under their patch; `by_mass` and `by_tau` are derivatives of the `receptance` (..., N).
    """

    loss: ComplexArray
    answer: ComplexArray
    patch: _Patch
    by_mass: ComplexArray
    by_tau: ComplexArray
    receptance: ComplexArray

    @classmethod
    def of(cls, shell: Shell, sets: FloatArray, w: FloatArray) -> _Moving:
        mass, loss = sets[..., 6, None], 1 + 1j * w * sets[..., 7, None]
        springs, shape, patch, rest = shell.parts(sets)
        yields = loss[..., None, :, None] * springs[..., None, :] - (mass * w**2)[..., None, :, None]
        answer: ComplexArray = np.asarray((shape[..., 2, None, :] / yields) @ np.swapaxes(shape, -1, -2))
        weight = patch.weight[..., None]
        moved = np.sum(weight * answer[..., 2], axis=-2)
        by_mass = w**2 * np.sum(weight * np.sum(answer**2, axis=-1), axis=-2)
        by_tau = -1j * w / loss * (moved + mass * by_mass) - 1j * w * rest[..., None] / loss**2
        return cls(loss, answer, patch, by_mass, by_tau, moved + rest[..., None] / loss)


def _contracted(squares: np.ndarray, by_stiffness: FloatArray) -> np.ndarray:
    """Sums (..., N, P) over harmonics and entries of (..., N, pairs, 6) times (..., pairs, 6, P)."""
    flat = by_stiffness.reshape(*by_stiffness.shape[:-3], -1, by_stiffness.shape[-1])
    return np.asarray(squares.reshape(*squares.shape[:-2], -1) @ flat)


def _sinc_slope(x: FloatArray) -> FloatArray:
    """Derivative of sin(x)/x, near zero by its series up to x^5."""
    small = np.abs(x) < 1e-2
    safe = np.where(small, 1.0, x)
    return np.asarray(
        np.where(small, -x / 3 * (1 - x**2 / 10 * (1 - x**2 / 28)), (np.cos(safe) - np.sin(safe) / safe) / safe)
    )
