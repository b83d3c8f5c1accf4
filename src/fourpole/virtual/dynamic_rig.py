"""The dynamic rig in the time domain: cam, tyre, moving mass, leaf spring to the foundation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, inf, isfinite, isinf

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.models.interface import StateSpace
from fourpole.virtual.cam import Cam
from fourpole.virtual.march import held_force, recur, respond

#: A transient has decayed after this many time constants: e^-37 is below round-off.
_SETTLED = 37.0
#: Largest number of states times steps of a run-up, which is 160 MB.
_LONGEST = 2e7
#: A frame that follows its spring at a rate above this is treated as quasi-static [rad/s].
_AT_ONCE = 1e9
#: The sign of the friction is smoothed over this share of the amplitude that v2 has without friction.
_SMOOTHED = 0.05
#: The iteration for friction has converged if the motion changes by less than this share of its peak; most iterations.
_CONVERGED, _ITERATIONS = 1e-11, 500


@dataclass(frozen=True)
class Zener:
    """A massless tyre at one frequency: K1 parallel to a spring K2 and a damper C in series; all > 0.

    Parameters
    ----------
    k1, k2, c : float [N/m], [N/m], [N s/m]
        Spring K1, spring K2 and damper C.
    """

    k1: float
    k2: float
    c: float

    def state_space(self) -> StateSpace:
        r"""The element in state space: its state q [N] is the force in the arm of K2 and C.

        .. math:: \dot q = K_2 v - (K_2/C)\,q, \qquad F = K_1 x + q

        The deflection of the spring K2 is that of the arm minus that of the damper.

        Raises
        ------
        ValueError
            If a constant is not positive.
        """
        if not min(self.k1, self.k2, self.c) > 0.0:
            raise ValueError("K1, K2 and C must be > 0")
        return StateSpace(
            np.array([[-self.k2 / self.c]]), np.array([[0.0, self.k2]]), np.ones(1), np.array([self.k1, 0.0])
        )


@dataclass(frozen=True)
class Bench:
    r"""The rig above the tyre: a moving mass, with a leaf spring and a damper to a fixed foundation.

    Parameters
    ----------
    mass, preload_stiffness, preload_damping : float [kg], [N/m], [N s/m]
        m > 0, K3 >= 0, c3 >= 0.
    tyre_mass : float [kg]
        Moving part of the tyre, lumped with the moving mass; >= 0.
    frame_stiffness : float [N/m]
        Stiffness of the frame in series with leaf spring and damper; > 0, by default rigid.
    preload_loss_factor : float [1]
        eta of the leaf spring; >= 0. In the time domain it becomes the damper K3 eta/omega, which has the same loss at
        the mean frequency of the cam, and n times the loss at n times that frequency.
    leaf_friction : float [N]
        Coulomb friction F_f between the moving mass and the foundation; >= 0.
    input_mass : float [kg]
        Mass between force cell and contact, whose inertia is part of F1; >= 0.

    Examples
    --------
    >>> Bench(preload_loss_factor=0.02).damped_at(10.0).preload_damping
    3.9598
    """

    mass: float = 15.0
    preload_stiffness: float = 12440.0
    preload_damping: float = 0.0
    tyre_mass: float = 0.0
    frame_stiffness: float = inf
    preload_loss_factor: float = 0.0
    leaf_friction: float = 0.0
    input_mass: float = 0.0

    def damped_at(self, frequency: float) -> Bench:
        """The bench with its loss factor replaced by a damper of the same loss at `frequency` [Hz]."""
        if not self.preload_loss_factor:
            return self
        structural = self.preload_stiffness * self.preload_loss_factor / (2.0 * np.pi * frequency)
        return replace(self, preload_damping=self.preload_damping + structural, preload_loss_factor=0.0)

    def check(self) -> None:
        """Raise a ValueError if a value is out of its range."""
        least = (self.preload_stiffness, self.preload_damping, self.tyre_mass, self.preload_loss_factor)
        if not (self.mass > 0.0 and min(*least, self.leaf_friction, self.input_mass) >= 0.0):
            raise ValueError("the moving mass must be > 0 and all other values of the rig >= 0")
        if not self.frame_stiffness > 0.0:
            raise ValueError("frame_stiffness must be > 0; infinite where the frame is rigid")


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
        Displacement and velocity of the moving mass.
    force : (n,) float array [N]
        F1 at the contact without the preload; positive if it pushes the tyre towards the mass.
    """

    time: FloatArray
    x1: FloatArray
    v1: FloatArray
    x2: FloatArray
    v2: FloatArray
    force: FloatArray


def state_matrices(tyre: Zener | StateSpace, bench: Bench) -> tuple[FloatArray, FloatArray]:
    r"""Matrices A, B of the equations of motion y' = A y + B u with y = (x2, v2, z) and u = (x1, v1).

    The states z of the tyre and its force F follow from its deflection and deflection rate:

    .. math::

        \dot z &= A_t z + B_t \begin{bmatrix} x_1 - x_2 \\ v_1 - v_2 \end{bmatrix}, \qquad
        F = C_t z + D_t \begin{bmatrix} x_1 - x_2 \\ v_1 - v_2 \end{bmatrix} \\
        m\,\dot v_2 &= F - K_3 x_2 - c_3 v_2

    For a compliant frame, its motion x3 is the last state, and the force on the mass is that of the frame:

    .. math::

        m\,\dot v_2 &= F - K_f x_3 \\
        c_3\,\dot x_3 &= c_3 v_2 + K_3 (x_2 - x_3) - K_f x_3

    These equations have no friction. `Bench.damped_at` must have replaced a loss factor by a damper.

    Raises
    ------
    ValueError
        If the bench has a loss factor, or a constant of the element is not positive.

    Examples
    --------
    >>> a, b = state_matrices(Zener(120e3, 90e3, 800.0), Bench())
    >>> a.shape, b.shape, bool((np.linalg.eigvals(a).real < 0).all())
    ((3, 3), (3, 2), True)
    """
    if bench.preload_loss_factor:
        raise ValueError("a loss factor has no equation of motion: replace it by a damper with Bench.damped_at")
    tyre = _equations(tyre)
    m = bench.mass + bench.tyre_mass
    k3, c3, frame = _leaf(bench)
    size = 2 + tyre.a.shape[0]
    a = np.zeros((size, size))
    a[0, 1] = 1.0
    a[1, :2] = -(tyre.d + np.array([k3, c3])) / m
    a[1, 2:] = tyre.c / m
    a[2:, :2] = -tyre.b
    a[2:, 2:] = tyre.a
    b = np.vstack([np.zeros(2), tyre.d / m, tyre.b])
    if isfinite(frame):
        a = np.pad(a, (0, 1))
        a[1, :2] = -tyre.d / m
        a[1, -1] = -frame / m
        a[-1, [0, 1, -1]] = k3 / c3, 1.0, -(k3 + frame) / c3
        b = np.pad(b, ((0, 1), (0, 0)))
    return a + 0.0, b  # the sum changes negative zeros into positive ones


def _equations(tyre: Zener | StateSpace) -> StateSpace:
    """The tyre in state space."""
    return tyre if isinstance(tyre, StateSpace) else tyre.state_space()


def _leaf(bench: Bench) -> tuple[float, float, float]:
    """K3 [N/m], c3 [N s/m] and the stiffness of the frame in series with them [N/m].

    If the damper is so weak that the frame follows within a step, leaf and frame are combined into one spring and
    damper on a rigid frame. The relative error of the stiffness is then (omega c3)^2 / (K3 (K3 + frame)), for example
    1e-11 at 24 Hz for a frame 500 times stiffer than K3.
    """
    k3, c3, frame = bench.preload_stiffness, bench.preload_damping, bench.frame_stiffness
    if isinf(frame) or k3 + frame <= _AT_ONCE * c3:
        return k3, c3, frame
    share = frame / (k3 + frame)
    return k3 * share, c3 * share * share, inf


def run(
    cam: Cam,
    tyre: Zener | StateSpace,
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
    tyre : Zener or StateSpace
        The element for one frequency, or any model in the time domain from `fourpole.models.chain.in_time`.
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
        If a constant is out of its range, or if tyre and rig have so little damping that no steady motion is found.

    Notes
    -----
    Friction is the force :math:`-F_f \tanh(v_2/v_s)` on the mass. Its sign is smoothed over v_s, which is 5 % of the
    amplitude of v2 without friction, so that the time base resolves each reversal. The first harmonic is 4/pi F_f to
    0.5 %, and the mass creeps instead of sticking. The friction may be up to about a fourth of |K*| e, the force that
    would hold the mass. A larger friction needs more than this first harmonic.

    The motion with friction is found by iteration over the whole record. A damper d = F_f/(2 v_s) is added to the
    equations of motion and subtracted from the friction, whose slope then is within +-d. The iteration converges for
    any friction, because the mobility of a passive rig with this damper is at most 1/d.

    Examples
    --------
    >>> tyre = Zener(k1=120e3, k2=90e3, c=800.0)
    >>> motion = run(Cam(frequency=10.0), tyre, Bench(), duration=1.0, guard=0)
    >>> float((np.ptp(motion.v2) / np.ptp(motion.v1)).round(3))  # the transmissibility
    1.435
    """
    _check_times(cam, duration, sample_rate, oversampling, guard)
    tyre = _equations(tyre)
    bench.check()
    bench = bench.damped_at(cam.frequency)
    a, b = state_matrices(tyre, bench)
    step = 1.0 / (sample_rate * oversampling)
    run_up = _run_up(a, step)
    if bench.leaf_friction:  # the steepest slope of the friction may slow the decay of transients
        width = _SMOOTHED * cam.eccentricity * 2.0 * np.pi * cam.frequency * amplification(tyre, bench, cam.frequency)
        damper = 0.5 * bench.leaf_friction / width
        run_up = max(run_up, _run_up(_with_damper(a, 2.0 * damper, bench), step))
    points = (round(duration * sample_rate) - 1) * oversampling + 1 + 2 * guard
    time: FloatArray = np.arange(-guard - run_up, points - guard, dtype=float) * step
    x1, v1 = cam.motion(time)
    kept = slice(run_up, None)
    if bench.leaf_friction:
        states = _with_friction(_with_damper(a, damper, bench), b, bench, width, np.stack([x1, v1]), step)[:, kept]
    else:
        states = respond(a, b, x1, v1, step, kept)
    x2, v2 = states[:2]
    inner = states[2 : 2 + tyre.a.shape[0]]
    # einsum, because the threads that matmul starts cost more time here than they save
    force = tyre.d[0] * (x1[kept] - x2) + np.einsum("i,ij->j", tyre.c, inner) + tyre.d[1] * (v1[kept] - v2)
    if bench.input_mass:
        force += bench.input_mass * cam.acceleration(time[kept])
    return Motion(time[kept], x1[kept], v1[kept], x2, v2, force)


def run_block(
    cam: Cam,
    bench: Bench,
    *,
    duration: float,
    sample_rate: float = 1000.0,
    oversampling: int = 5,
    guard: int = 8,
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
    _check_times(cam, duration, sample_rate, oversampling, guard)
    bench.check()
    bench = bench.damped_at(cam.frequency)
    k3, c3, frame = _leaf(bench)
    step = 1.0 / (sample_rate * oversampling)
    behind = np.zeros((1, 1)) if isinf(frame) else np.array([[-(k3 + frame) / c3]])  # the motion of the frame
    run_up = 0 if isinf(frame) else _run_up(behind, step)
    points = (round(duration * sample_rate) - 1) * oversampling + 1 + 2 * guard
    time: FloatArray = np.arange(-guard - run_up, points - guard, dtype=float) * step
    x1, v1 = cam.motion(time)
    kept = slice(run_up, None)
    held = k3 * x1 + c3 * v1
    if isfinite(frame):
        held = frame * respond(behind, np.array([[k3 / c3, 1.0]]), x1, v1, step, kept)[0]
    time, x1, v1 = time[kept], x1[kept], v1[kept]
    force = held + (bench.mass + bench.input_mass) * cam.acceleration(time)
    if bench.leaf_friction:
        width = _SMOOTHED * cam.eccentricity * 2.0 * np.pi * cam.frequency
        force += bench.leaf_friction * np.tanh(v1 / width)
    return Motion(time, x1, v1, x1.copy(), v1.copy(), force)


def _check_times(cam: Cam, duration: float, sample_rate: float, oversampling: int, guard: int) -> None:
    """Raise ValueError if a value is out of its range."""
    if not min(cam.frequency, cam.eccentricity, duration, sample_rate) > 0.0:
        raise ValueError("frequency, eccentricity, duration and sample_rate must be > 0")
    if oversampling < 1 or guard < 0:
        raise ValueError("oversampling must be >= 1 and guard >= 0")


def _run_up(a: FloatArray, step: float) -> int:
    """Number of steps until the slowest transient has decayed."""
    decay = -float(np.linalg.eigvals(a).real.max())
    if not decay * step * _LONGEST > _SETTLED * a.shape[0]:
        raise ValueError(
            f"no steady motion: the slowest transient of tyre and rig decays too slowly, at {decay:.3g} per second; "
            "give the tyre or the preload spring a damper, or leave out long relaxation times"
        )
    return ceil(_SETTLED / decay / step)


def amplification(tyre: Zener | StateSpace, bench: Bench, frequency: float) -> float:
    """|V2/V1| [1] at one `frequency` [Hz], from the equations of motion.

    Examples
    --------
    >>> round(amplification(Zener(k1=120e3, k2=90e3, c=800.0), Bench(), 10.0), 3)
    1.435
    """
    a, b = state_matrices(tyre, bench)
    s = 2j * np.pi * frequency
    return float(abs(np.linalg.solve(s * np.eye(a.shape[0]) - a, b @ np.array([1.0, s]))[0]))


def _with_damper(a: FloatArray, damper: float, bench: Bench) -> FloatArray:
    """The same equations with a further `damper` [N s/m] from the moving mass to the foundation."""
    damped = a.copy()
    damped[1, 1] -= damper / (bench.mass + bench.tyre_mass)
    return damped


def _with_friction(
    damped: FloatArray, b: FloatArray, bench: Bench, width: float, contact: FloatArray, step: float
) -> FloatArray:
    """States of a rig with friction, by iteration; `damped` includes a damper of half the steepest slope."""
    damper = 0.5 * bench.leaf_friction / width
    whole = slice(0, None)
    on_mass = np.zeros((b.shape[0], 1))
    on_mass[1] = 1.0 / (bench.mass + bench.tyre_mass)
    push = held_force(damped, on_mass, step)
    by_cam = respond(damped, b, contact[0], contact[1], step, whole)
    states = by_cam
    for _ in range(_ITERATIONS):
        force = damper * states[1] - bench.leaf_friction * np.tanh(states[1] / width)
        nearer = by_cam + recur(damped, push, np.stack([force[:-1], force[1:]]), step, whole)
        change = np.abs(nearer[1] - states[1]).max()
        states = nearer
        if change <= _CONVERGED * np.abs(states[1]).max():
            return states
    raise ValueError(
        f"leaf_friction of {bench.leaf_friction:g} N: no steady motion, it nearly holds the mass; use less"
    )
