"""The dynamic rig in the time domain: cam, tyre, moving mass, leaf spring to the foundation."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, isfinite, isinf

import numpy as np
import scipy

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.models.step import cubic_step
from fourpole.virtual.bench import Bench, Element, Laden, equations, far_end, leaf, state_matrices
from fourpole.virtual.cam import Cam

#: A transient has decayed after this many time constants: e^-37 is below round-off.
_SETTLED = 37.0
#: Largest number of states times steps of a run-up, which is 160 MB.
_LONGEST = 2e7
#: The sign of the friction is smoothed over this share of the amplitude that v2 has without friction.
_SMOOTHED = 0.05
#: The iteration for friction ends if the motion changes by less than this share; most iterations.
_CONVERGED, _ITERATIONS = 1e-11, 500


@dataclass(frozen=True, eq=False)
class Motion(ByValue):
    """The steady motion of the rig on a uniform, fine time base.

    Parameters
    ----------
    time : (n,) float array [s]
        Uniform times.
    x1, v1 : (n,) float arrays [m], [m/s]
        Displacement and velocity of the contact, which the cam prescribes.
    x2, v2 : (n,) float arrays [m], [m/s]
        Displacement and velocity of the moving mass, where the sensor V2 is.
    force : (n,) float array [N]
        F1 at the contact without the preload; positive if it pushes the tyre towards the mass.
    deflection : (n,) float array [m]
        Deflection of the tyre.
    """

    time: FloatArray
    x1: FloatArray
    v1: FloatArray
    x2: FloatArray
    v2: FloatArray
    force: FloatArray
    deflection: FloatArray


def run(
    cam: Cam,
    tyre: Element,
    bench: Bench,
    *,
    duration: float,
    sample_rate: float = 1000.0,
    oversampling: int = 5,
    guard: int = 8,
) -> Motion:
    r"""Steady motion of the rig over a `duration`, after the transients of its start.

    Between the points of the fine time base, the prescribed motion is the cubic with its values and velocities at both
    ends. A matrix exponential then solves the equations of motion exactly. The error of the cubic is at most
    (omega h)^4/384 of the motion, which is 2e-9 at 24 Hz in steps of 0.2 ms. If a model has masses that follow within
    a step, the relative error of their force is (omega h)^2/12, like that of the cubic's acceleration at its ends.

    Parameters
    ----------
    cam : Cam
    tyre : Zener, StateSpace or Laden
        The element for one frequency, any model in the time domain from `fourpole.models.chain.in_time`, or a specimen
        with masses between its springs.
    bench : Bench
    duration, sample_rate : float [s], [Hz]
        Length and sampling rate of the record.
    oversampling : int
        Fine points per sample; >= 1.
    guard : int
        Fine points before time 0 and after the end, for sensors with a delay.

    Returns
    -------
    Motion
        Points -guard to (samples - 1) * oversampling + guard, in steps of 1/(sample_rate * oversampling).

    Raises
    ------
    ValueError
        If a constant is out of its range, or tyre and rig have so little damping that no steady motion is found.

    Notes
    -----
    Friction is the force :math:`-F_f \tanh(v_2/v_s)` on the mass. Its sign is smoothed over v_s, which is 5 % of the
    amplitude of v2 without friction, so that the time base resolves each reversal. The first harmonic is 4/pi F_f to
    0.5 %, and the mass creeps instead of sticking. The friction may be up to about a fourth of
    :math:`|K^*| e`, the force that would hold the mass. A larger friction needs more than this first harmonic.

    The motion with friction is found by iteration over the whole record. A damper d = F_f/(2 v_s) is added to the
    equations of motion and subtracted from the friction, whose slope then is within +-d. The iteration converges for
    any friction, because the mobility of a passive rig with this damper is at most 1/d.

    Examples
    --------
    >>> from fourpole.virtual.bench import Zener
    >>> tyre = Zener(k1=120e3, k2=90e3, c=800.0)
    >>> motion = run(Cam(frequency=10.0), tyre, Bench(), duration=1.0, guard=0)
    >>> float((np.ptp(motion.v2) / np.ptp(motion.v1)).round(3))  # the transmissibility
    1.435
    """
    base = _Base.of(cam, bench, duration, sample_rate, oversampling, guard)
    bench, step = bench.damped_at(cam.frequency), base.step
    tyre = tyre if isinstance(tyre, Laden) else equations(tyre)
    a, b = state_matrices(tyre, bench)
    run_up = _run_up(a, step)
    width = 0.0
    if bench.leaf_friction:
        width = _SMOOTHED * cam.eccentricity * 2.0 * np.pi * cam.frequency * abs(far_end(tyre, bench, cam.frequency))
        # the steepest slope of the friction may slow the decay of transients
        run_up = max(run_up, _run_up(_damped(a, bench, bench.leaf_friction / width), step))
    time, kept = base.times(run_up), slice(run_up, None)
    x1, v1 = cam.motion(time)
    states = _rubbing(a, b, bench, width, (x1, v1), step)[:, kept] if width else respond(a, b, x1, v1, step, kept)
    x2, v2 = states[:2]
    first = tyre.springs[0] if isinstance(tyre, Laden) else tyre
    inner, behind = np.split(states[2:], [first.a.shape[0]])
    behind = behind if isinstance(tyre, Laden) else states[:2]
    # einsum, because the threads that matmul starts cost more time here than they save
    x, v = x1[kept] - behind[0], v1[kept] - behind[1]
    force = first.d[0] * x + np.einsum("i,ij->j", first.c, inner) + first.d[1] * v
    if bench.input_mass:
        force += bench.input_mass * cam.acceleration(time[kept])
    return Motion(time[kept], x1[kept], v1[kept], x2, v2, force, x1[kept] - x2)


def run_block(
    cam: Cam, bench: Bench, *, duration: float, sample_rate: float = 1000.0, oversampling: int = 5, guard: int = 8
) -> Motion:
    """Steady motion of the rig with a rigid block in place of the tyre, for a calibration: x2 is x1.

    Parameters
    ----------
    cam : Cam
    bench : Bench
        Its mass is that of moving mass and block; its tyre mass has no effect.
    duration, sample_rate, oversampling, guard
        The same as for `run`.

    Returns
    -------
    Motion

    Raises
    ------
    ValueError
        If a constant is out of its range.

    Examples
    --------
    >>> motion = run_block(Cam(frequency=10.0), Bench(mass=20.0), duration=1.0)
    >>> float((np.ptp(motion.force) / np.ptp(motion.x1)).round(1)), (20.0 * (20.0 * np.pi) ** 2 - 12440.0).__round__(1)
    (66516.8, 66516.8)
    """
    base = _Base.of(cam, bench, duration, sample_rate, oversampling, guard)
    k3, c3, frame = leaf(bench.damped_at(cam.frequency))
    behind = np.zeros((1, 1)) if isinf(frame) else np.array([[-(k3 + frame) / c3]])  # the motion of the frame
    run_up = 0 if isinf(frame) else _run_up(behind, base.step)
    time, kept = base.times(run_up), slice(run_up, None)
    x1, v1 = cam.motion(time)
    held = k3 * x1 + c3 * v1
    if isfinite(frame):
        held = frame * respond(behind, np.array([[k3 / c3, 1.0]]), x1, v1, base.step, kept)[0]
    time, x1, v1 = time[kept], x1[kept], v1[kept]
    force = held + (bench.mass + bench.input_mass) * cam.acceleration(time)
    if bench.leaf_friction:
        width = _SMOOTHED * cam.eccentricity * 2.0 * np.pi * cam.frequency
        force += bench.leaf_friction * np.tanh(v1 / width)
    return Motion(time, x1, v1, x1.copy(), v1.copy(), force, np.zeros_like(x1))


@dataclass(frozen=True)
class _Base:
    """A fine time base: its step [s], and its points from `first` on, 0 being the first sample."""

    step: float
    first: int
    points: int

    @classmethod
    def of(cls, cam: Cam, bench: Bench, duration: float, sample_rate: float, oversampling: int, guard: int) -> _Base:
        """The time base of `run`; ValueError if a value is out of its range."""
        if not min(cam.frequency, cam.eccentricity, duration, sample_rate) > 0.0:
            raise ValueError("frequency, eccentricity, duration and sample_rate must be > 0")
        if oversampling < 1 or guard < 0:
            raise ValueError("oversampling must be >= 1 and guard >= 0")
        bench.check()
        points = (round(duration * sample_rate) - 1) * oversampling + 1 + 2 * guard
        return cls(1.0 / (sample_rate * oversampling), -guard, points)

    def times(self, run_up: int) -> FloatArray:
        """Times [s], with those of a run-up before."""
        return np.arange(self.first - run_up, self.first + self.points, dtype=float) * self.step


def _run_up(a: FloatArray, step: float) -> int:
    """Number of steps until the slowest transient has decayed."""
    decay = -float(np.linalg.eigvals(a).real.max())
    if not decay * step * _LONGEST > _SETTLED * a.shape[0]:
        raise ValueError(
            f"no steady motion: the slowest transient of tyre and rig decays too slowly, at {decay:.3g} per second; "
            "give the tyre or the preload spring a damper, or leave out long relaxation times"
        )
    return ceil(_SETTLED / decay / step)


def _damped(a: FloatArray, bench: Bench, damper: float) -> FloatArray:
    """The equations of motion with a further damper [N s/m] between the moving mass and the foundation."""
    a = a.copy()
    a[1, 1] -= damper / (bench.mass + bench.tyre_mass)
    return a


def _rubbing(
    a: FloatArray, b: FloatArray, bench: Bench, width: float, contact: tuple[FloatArray, FloatArray], step: float
) -> FloatArray:
    """States of a rig with friction between the moving mass and the foundation, by iteration."""
    whole, damper = slice(0, None), 0.5 * bench.leaf_friction / width
    a = _damped(a, bench, damper)
    column = np.zeros((a.shape[0], 1))
    column[1] = 1.0 / (bench.mass + bench.tyre_mass)
    push = held_force(a, column, step)
    by_cam = respond(a, b, *contact, step, whole)
    states = by_cam
    for _ in range(_ITERATIONS):
        force = damper * states[1] - bench.leaf_friction * np.tanh(states[1] / width)
        nearer = by_cam + recur(a, push, np.stack([force[:-1], force[1:]]), step, whole)
        change = np.abs(nearer[1] - states[1]).max()
        states = nearer
        if not np.isfinite(change):
            break
        if change <= _CONVERGED * np.abs(states[1]).max():
            return states
    raise ValueError(
        f"leaf_friction of {bench.leaf_friction:g} N: no steady motion, it nearly holds the mass; use less"
    )


# Exact solution of z' = A z + B u in equal steps, for inputs u that are polynomials within a step


def held_force(a: FloatArray, column: FloatArray, step: float) -> FloatArray:
    """Change of the states in one step (n, 2) per unit of a force at both ends of the step, linear between them."""
    size = a.shape[0]
    chain = np.zeros((size + 2, size + 2))
    chain[:size, :size] = a * step
    chain[:size, size] = column[:, 0] * step
    chain[size, size + 1] = 1.0
    return np.asarray(scipy.linalg.expm(chain)[:size, size:] @ np.array([[1.0, 0.0], [-1.0, 1.0]]))


def respond(a: FloatArray, b: FloatArray, x1: FloatArray, v1: FloatArray, step: float, kept: slice) -> FloatArray:
    """States (n, kept) from rest at the first point; the input is a cubic between the points."""
    _, push = cubic_step(a, b, step)
    ends = np.stack([x1[:-1], step * v1[:-1], x1[1:], step * v1[1:]])
    return recur(a, push, ends, step, kept)


def recur(a: FloatArray, push: FloatArray, ends: FloatArray, step: float, kept: slice) -> FloatArray:
    """States (n, kept) from rest: in each step the modes decay, and `push` times the input at its `ends` is added."""
    values, vectors = np.linalg.eig(a)
    if np.linalg.cond(vectors / np.abs(vectors).max(axis=1, keepdims=True)) > 1e9:
        return march(scipy.linalg.expm(a * step), push @ ends)[:, kept]
    keep = values.imag >= 0.0  # one mode of each conjugate pair is sufficient
    modal_push = np.linalg.solve(vectors, push.astype(complex))[keep]
    # einsum, because the threads that matmul starts cost more time here than they save
    drives = np.einsum("ij,jk->ik", np.vstack([modal_push.real, modal_push.imag]), ends)
    half = modal_push.shape[0]
    modes, weights = [], []
    for value, vector, re, im in zip(values[keep], vectors.T[keep], drives[:half], drives[half:], strict=True):
        pole = np.exp(value * step)
        if value.imag == 0.0:
            modes.append(scipy.signal.lfilter([1.0], [1.0, -pole.real], re))
            weights.append(vector.real)
        else:
            mode = scipy.signal.lfilter([1.0], [1.0, -pole], re + 1j * im)
            modes += [mode.real, mode.imag]
            weights += [2.0 * vector.real, -2.0 * vector.imag]
    history = np.stack([np.concatenate([[0.0], mode])[kept] for mode in modes])
    return np.asarray(np.einsum("ij,ik->jk", np.stack(weights), history))


def march(transition: FloatArray, pushes: FloatArray) -> FloatArray:
    """States (n, steps + 1) by the recursion step by step, for the rare system whose modes coincide."""
    states = np.zeros((pushes.shape[0], pushes.shape[1] + 1))
    for index in range(pushes.shape[1]):
        states[:, index + 1] = transition @ states[:, index] + pushes[:, index]
    return states
