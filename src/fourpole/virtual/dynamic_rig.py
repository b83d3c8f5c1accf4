"""The dynamic rig in the time domain: cam, massless tyre, moving mass, leaf spring to the foundation."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

__all__ = ["Bench", "Cam", "Motion", "Zener", "run", "state_matrices"]

FloatArray = NDArray[np.float64]

#: A transient has gone when it has fallen by this many e-foldings: e^-37 is below round-off.
_SETTLED = 37.0


@dataclass(frozen=True)
class Cam:
    r"""A disc with an eccentricity, its profile errors, and the unsteady speed at which it turns.

    .. math::

        x_1 = e\,\Bigl(\sin\theta + \sum_n a_n \sin(n\theta + \phi_n)\Bigr), \qquad
        \theta = \omega t + \sum_n \frac{r_n}{n}\sin(n\omega t + \psi_n)
                 + \frac{w\,\omega T}{2\pi}\sin(2\pi t/T + \psi_w)

    Parameters
    ----------
    frequency : float [Hz]
        Mean revolutions per second; > 0.
    eccentricity : float [m]
        e, the amplitude of the motion.
    profile : tuple of (order, fraction [1], phase [rad])
        n, a_n and phi_n: harmonics of the profile, relative to the eccentricity.
    ripple : tuple of (order, fraction [1], phase [rad])
        n, r_n and psi_n: the speed varies by the fraction r_n, n times per revolution.
    wander, wander_period, wander_phase : float [1], [s], [rad]
        w, T, psi_w: the speed varies slowly by the fraction w; over whole periods its mean is `frequency`.

    Examples
    --------
    >>> x1, v1 = Cam(frequency=10.0).motion(np.array([0.0, 0.025]))
    >>> x1.round(6).tolist(), v1.round(6).tolist()
    ([0.0, 0.001], [0.062832, 0.0])
    """

    frequency: float
    eccentricity: float = 1e-3
    profile: tuple[tuple[int, float, float], ...] = ()
    ripple: tuple[tuple[int, float, float], ...] = ()
    wander: float = 0.0
    wander_period: float = 4.0
    wander_phase: float = 0.0

    def motion(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacement x1 [m] and velocity v1 [m/s] of the contact at `time` [s]."""
        omega = 2.0 * np.pi * self.frequency
        angle = omega * time
        speed = np.full_like(angle, omega)
        if self.ripple:
            turns = _multiples(angle, max(order for order, _, _ in self.ripple))
            for order, fraction, phase in self.ripple:
                part = turns[order - 1] * (fraction * np.exp(1j * phase))
                angle = angle + part.imag / order
                speed += omega * part.real
        if self.wander:
            slow = 2.0 * np.pi / self.wander_period
            angle = angle + self.wander * omega / slow * np.sin(slow * time + self.wander_phase)
            speed += self.wander * omega * np.cos(slow * time + self.wander_phase)
        turns = _multiples(angle, max((order for order, _, _ in self.profile), default=1))
        x, slope = turns[0].imag.copy(), turns[0].real.copy()
        for order, fraction, phase in self.profile:
            part = turns[order - 1] * (fraction * np.exp(1j * phase))
            x += part.imag
            slope += order * part.real
        return self.eccentricity * x, self.eccentricity * slope * speed


def _multiples(angle: FloatArray, highest: int) -> list[NDArray[np.complex128]]:
    """e^{jna} for n = 1 ... highest, by multiplication: much faster than that many exponentials."""
    first = np.empty(angle.shape, dtype=complex)
    first.real, first.imag = np.cos(angle), np.sin(angle)
    powers = [first]
    while len(powers) < highest:
        powers.append(powers[-1] * first)
    return powers


@dataclass(frozen=True)
class Zener:
    """A massless tyre at one frequency: K1 beside a spring K2 and a damper C in series; all > 0.

    Parameters
    ----------
    k1, k2, c : float [N/m], [N/m], [N s/m]
    """

    k1: float
    k2: float
    c: float


@dataclass(frozen=True)
class Bench:
    """What stands on the tyre: a moving mass, and a leaf spring and damper from it to a fixed foundation.

    Parameters
    ----------
    mass, preload_stiffness, preload_damping : float [kg], [N/m], [N s/m]
        m > 0, K3 >= 0, c3 >= 0.
    """

    mass: float = 15.0
    preload_stiffness: float = 12440.0
    preload_damping: float = 0.0


@dataclass(frozen=True)
class Motion:
    """The settled motion of the rig on a uniform, fine time base.

    Parameters
    ----------
    time : (n,) float array [s]
    x1, v1 : (n,) float arrays [m], [m/s]
        Of the contact, as the cam prescribes it.
    x2, v2 : (n,) float arrays [m], [m/s]
        Of the moving mass.
    force : (n,) float array [N]
        F1 at the contact, without the preload; positive as it pushes the tyre towards the mass.
    """

    time: FloatArray
    x1: FloatArray
    v1: FloatArray
    x2: FloatArray
    v2: FloatArray
    force: FloatArray


def state_matrices(tyre: Zener, bench: Bench) -> tuple[FloatArray, FloatArray]:
    r"""Matrices A, B of the equations of motion z' = A z + B u with z = (x2, v2, q) and u = (x1, v1).

    .. math::

        m\,\dot v_2 &= K_1 (x_1 - x_2) + q - K_3 x_2 - c_3 v_2 \\
        \dot q &= K_2 (v_1 - v_2) - (K_2/C)\,q

    q [N] is the force in the arm K2-C: what stretches the spring is what the damper has not yet given way to.

    Examples
    --------
    >>> a, b = state_matrices(Zener(120e3, 90e3, 800.0), Bench())
    >>> a.shape, b.shape, bool((np.linalg.eigvals(a).real < 0).all())
    ((3, 3), (3, 2), True)
    """
    m, k3, c3 = bench.mass, bench.preload_stiffness, bench.preload_damping
    a = np.array(
        [
            [0.0, 1.0, 0.0],
            [-(tyre.k1 + k3) / m, -c3 / m, 1.0 / m],
            [0.0, -tyre.k2, -tyre.k2 / tyre.c],
        ]
    )
    b = np.array([[0.0, 0.0], [tyre.k1 / m, 0.0], [0.0, tyre.k2]])
    return a, b


def run(
    cam: Cam,
    tyre: Zener,
    bench: Bench,
    *,
    duration: float,
    sample_rate: float = 1000.0,
    oversampling: int = 5,
    guard: int = 8,
) -> Motion:
    """Run the rig until it has settled, then for `duration` more, and return that last part.

    Between the points of the fine time base the prescribed motion is held as the cubic that has its values
    and its velocities at both ends; the equations of motion are then solved exactly, by a matrix exponential.
    What remains is the error of that cubic, at most (omega h)^4/384 of the motion: 2e-9 at 24 Hz in steps of
    0.2 ms.

    Parameters
    ----------
    cam : Cam
    tyre : Zener
    bench : Bench
    duration, sample_rate : float [s], [Hz]
        Of the record that is wanted.
    oversampling : int
        Fine points per sample; >= 1.
    guard : int
        Fine points kept before time 0 and after the end, for sensors that are late or early.

    Returns
    -------
    Motion
        From -guard to (samples - 1) * oversampling + guard in steps of 1/(sample_rate * oversampling).

    Raises
    ------
    ValueError
        If a constant is out of its range, so that no settled motion exists.

    Examples
    --------
    >>> tyre = Zener(k1=120e3, k2=90e3, c=800.0)
    >>> motion = run(Cam(frequency=10.0), tyre, Bench(), duration=1.0, guard=0)
    >>> float((np.ptp(motion.v2) / np.ptp(motion.v1)).round(3))  # the transmissibility
    1.435
    """
    constants = (tyre.k1, tyre.k2, tyre.c, bench.mass, cam.frequency, duration, sample_rate)
    if not (min(constants) > 0.0 and min(bench.preload_stiffness, bench.preload_damping) >= 0.0):
        raise ValueError("K1, K2, C, mass, frequency, duration and sample_rate must be > 0, K3 and c3 >= 0")
    if oversampling < 1 or guard < 0:
        raise ValueError("oversampling must be >= 1 and guard >= 0")
    a, b = state_matrices(tyre, bench)
    step = 1.0 / (sample_rate * oversampling)
    run_up = ceil(_SETTLED / -float(np.linalg.eigvals(a).real.max()) / step)
    points = (round(duration * sample_rate) - 1) * oversampling + 1 + 2 * guard
    time: FloatArray = np.arange(-guard - run_up, points - guard, dtype=float) * step
    x1, v1 = cam.motion(time)
    kept = slice(run_up, None)
    x2, v2, arm = _respond(a, b, x1, v1, step, kept)
    return Motion(time[kept], x1[kept], v1[kept], x2, v2, tyre.k1 * (x1[kept] - x2) + arm)


def _respond(a: FloatArray, b: FloatArray, x1: FloatArray, v1: FloatArray, step: float, kept: slice) -> FloatArray:
    """States (3, kept) from rest at the first point, the input held as a cubic between the points."""
    # a cubic is a chain of integrators started at its derivatives: append it to the system and exponentiate
    chain = np.zeros((7, 7))
    chain[:3, :3] = a * step
    chain[:3, 3] = b[:, 0] * step
    chain[:3, 4] = b[:, 1]  # the chain's time runs from 0 to 1, so its slope is step * v1
    chain[[3, 4, 5], [4, 5, 6]] = 1.0
    held = _exponential(chain)[:3]
    derivatives = np.array(  # of the cubic at the start of a step, from x and step * v at its ends
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-6.0, -4.0, 6.0, -2.0], [12.0, 6.0, -12.0, 6.0]]
    )
    push = held[:, 3:] @ derivatives
    ends = np.stack([x1[:-1], step * v1[:-1], x1[1:], step * v1[1:]])
    values, vectors = np.linalg.eig(a)
    if np.linalg.cond(vectors / np.abs(vectors).max(axis=1, keepdims=True)) > 1e9:
        return _march(held[:, :3], push @ ends)[:, kept]
    keep = values.imag >= 0.0  # one of each conjugate pair stands for both
    modal_push = np.linalg.solve(vectors, push.astype(complex))[keep]
    # einsum, not matmul: threads of a matrix library cost more here than they save
    drives = np.einsum("ij,jk->ik", np.vstack([modal_push.real, modal_push.imag]), ends)
    half = modal_push.shape[0]
    modes, weights = [], []
    for value, vector, re, im in zip(values[keep], vectors.T[keep], drives[:half], drives[half:], strict=True):
        pole = np.exp(value * step)
        if value.imag == 0.0:
            modes.append(lfilter([1.0], [1.0, -pole.real], re))
            weights.append(vector.real)
        else:
            mode = lfilter([1.0], [1.0, -pole], re + 1j * im)
            modes += [mode.real, mode.imag]
            weights += [2.0 * vector.real, -2.0 * vector.imag]
    history = np.stack([np.concatenate([[0.0], mode])[kept] for mode in modes])
    return np.asarray(np.einsum("ij,ik->jk", np.stack(weights), history))


def _exponential(matrix: FloatArray) -> FloatArray:
    """e^matrix of a small matrix by halving, Taylor's series and squaring; 2^-18/18! is below round-off."""
    halvings = max(0, ceil(np.log2(2.0 * np.abs(np.linalg.eigvals(matrix)).max() + 1e-300)))
    scaled = matrix / 2**halvings
    term = total = np.eye(matrix.shape[0])
    for order in range(1, 19):
        term = term @ scaled / order
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total


def _march(transition: FloatArray, pushes: FloatArray) -> FloatArray:
    """The same recursion step by step, for the rare system whose modes coincide."""
    states = np.zeros((pushes.shape[0], pushes.shape[1] + 1))
    for index in range(pushes.shape[1]):
        states[:, index + 1] = transition @ states[:, index] + pushes[:, index]
    return states
