r"""Model of the three phasors of a test, and its derivatives by K* and the shared values.

With the drive d (the true V1), T = K*/(K* + jw Zr) and the channels' gains g:

.. math:: (F_1, V_1, V_2) = d\,\bigl(g_F (Z_r T + j\omega m_{in}),\; g_1,\; g_2 T\bigr)

A rigid block in place of the tyre has T = 1. The drive is free in every test, so it is projected out of residual and
derivatives first. If K* scatters from test to test, its scatter is noise along the derivatives by K*.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fourpole.core.alone import deflection_amplitude
from fourpole.core.arrays import BoolArray, ByRows, ByValue, ComplexArray, FloatArray, inverse_of_two, parts
from fourpole.core.channelerrors import ChannelError
from fourpole.core.joint.shared import BELTS, BLOCKS, DRIFTS, OF_FAMILY, PARTS_OF_RUN, STEPS, Shared
from fourpole.core.phasor import Phasors
from fourpole.core.sources import Kind, Role
from fourpole.core.specimen import Ends, ends_of, massless
from fourpole.core.unstated import unstated_parts

#: Values of the rig on which an unstated frame in series with the preload spring acts.
_SUPPORT = ("preload_stiffness", "preload_damping", "preload_loss_factor", "frame_stiffness")
#: Least relative uncertainty of an amplitude, which is the resolution of single precision.
FLOOR = 1e-7
#: Largest logarithm of a gain: of a search that went astray.
_LARGE = 30.0


@dataclass(frozen=True, eq=False)
class Observed(ByRows):
    """Phasors of N tests with their weights, for comparison with a model.

    Attributes
    ----------
    omega, frequency_std : (N,) float arrays [rad/s], [Hz]
        Angular frequency, and standard uncertainty of the frequency.
    amplitudes : (N, 3) complex array
        Measured amplitudes; 0 for an absent channel.
    whiten : (N, 6, 6) float array
        W with W S W^T = 1 for the covariance S of the channels present; rows of absent channels are 0.
    mass_at : (N,) int array
        Index of the distinct mass that is fixed to the moving mass; -1 for none.
    rigid : (N,) bool array
        True for a rigid block in place of the tyre.
    turns : (N, e) complex array
        Change of the logarithm of the amplitude of the disturbed channel per unit of each error of the channels.
    disturbed : (N, e) int array
        Number of the channel that each error disturbs, the same in all rows.
    specimen : (N,) int array
        Number of the specimen of each test.
    place : (N,) float array [1]
        Place of each test in the run of its specimen, in lengths of the run; 0 on average.
    part_of_run : (N,) int array
        Number of the part of the run of its specimen, of `PARTS_OF_RUN` with equally many tests.
    deflection : (N,) float array [1]
        Logarithm of the amplitude of the deflection, V1 - V2 over omega, from the mean of all tests or from the curve
        of its condition; 0 where it is unknown.
    family : (N,) int array
        Number of the condition of each test without its frequency; any number for a rigid block.
    reference : (N,) complex array [N/m]
        K* at which the springs beside a specimen's mass have the share that is among the shared values.
    rod : (N,) bool array
        True where the mass of the specimen is spread along it.
    """

    omega: FloatArray
    frequency_std: FloatArray
    amplitudes: ComplexArray
    whiten: FloatArray
    mass_at: np.ndarray
    rigid: BoolArray
    turns: ComplexArray
    disturbed: np.ndarray
    specimen: np.ndarray
    place: FloatArray
    part_of_run: np.ndarray
    deflection: FloatArray
    family: np.ndarray
    reference: ComplexArray
    rod: BoolArray

    @classmethod
    def of(
        cls,
        phasors: Phasors,
        mass_at: np.ndarray,
        rigid: BoolArray,
        errors: Sequence[ChannelError] = (),
        run: tuple[np.ndarray, FloatArray, np.ndarray] | None = None,
    ) -> Observed:
        """The phasors of N tests, with the errors of their channels; `run`: specimen, place and part of the run."""
        amplitudes = phasors.amplitudes
        present = np.isfinite(amplitudes) & (amplitudes != 0)
        amplitudes = np.where(present, amplitudes, 0.0)
        whiten = whitening(phasors.covariance, amplitudes, present)
        turns = np.zeros((len(amplitudes), len(errors)), dtype=complex)
        for index, error in enumerate(errors):
            turns[:, index] = error.turn
        disturbed = np.broadcast_to(np.array([error.channel for error in errors], dtype=np.int8), turns.shape)
        none = np.zeros(len(amplitudes), dtype=int)
        specimen, place, part_of_run = run or (none, none.astype(float), none)
        with np.errstate(divide="ignore"):
            size = np.log(deflection_amplitude(amplitudes[:, 0], amplitudes[:, 1], amplitudes[:, 2], phasors.omega))
        known = present[:, 1] & present[:, 2] & np.isfinite(size) & ~rigid
        deflection = np.where(known, size - np.mean(size, where=known) if known.any() else 0.0, 0.0)
        no_belt = (specimen, np.ones(len(amplitudes), dtype=complex), np.zeros(len(amplitudes), dtype=bool))
        more = (specimen, place, part_of_run, deflection, *no_belt)
        return cls(phasors.omega, phasors.frequency_std, amplitudes, whiten, mass_at, rigid, turns, disturbed, *more)

    @property
    def channels(self) -> np.ndarray:
        """Number of the channel that each error (e,) disturbs."""
        return self.disturbed[0] if len(self.disturbed) else np.zeros(self.disturbed.shape[1], dtype=int)

    @property
    def turns_of_all(self) -> ComplexArray:
        """Change (N, 3, e) of the logarithm of each amplitude per unit of each error of the channels."""
        return np.where(self.channels == np.arange(3)[:, None], self.turns[:, None], 0.0)

    def added(self, masses: FloatArray) -> FloatArray:
        """Added mass of each test (N,) [kg], from the distinct masses [kg]."""
        return np.append(masses, 0.0)[self.mass_at]  # index -1 is the 0 for no mass

    def gains(self, shared: Shared, z: FloatArray) -> ComplexArray:
        """Complex gains of F1, V1, V2 in each test, measured over true: exp(a + j phi), (N, 3)."""
        of = shared.of_channels(z, self.turns.shape[-1])
        turned = self.turns @ np.where(self.channels[:, None] == np.arange(3), of[:, None], 0.0)
        return np.asarray(np.exp(np.clip(turned.real, -_LARGE, _LARGE) + 1j * turned.imag))

    def block(self, shared: Shared) -> np.ndarray:
        """Number of the block of each test (N,): its specimen and its added mass; -1 without a mass."""
        return np.where(self.mass_at < 0, -1, self.specimen * shared.masses.size + self.mass_at)

    def drifted(self, shared: Shared, z: FloatArray) -> ComplexArray:
        """K* of each test over that of its condition: by drift, step, block and amplitude (N,) [1]."""
        block = self.block(shared)
        drift = shared.of_specimens_at(z, DRIFTS, int(self.specimen.max(initial=0)) + 1)
        blocks = shared.of_specimens_at(z, BLOCKS, int(block.max(initial=-1)) + 1)
        more = shared.by_amplitude_at(z) * self.deflection + self._stepped(shared, z)
        return np.asarray(np.exp(drift[self.specimen] * self.place + np.append(blocks, 0.0)[block] + more))

    def _stepped(self, shared: Shared, z: FloatArray) -> ComplexArray:
        """Change of log K* of each test by the steps of its specimen before it (N,) [1] + j [rad]."""
        count = (int(self.specimen.max(initial=0)) + 1) * PARTS_OF_RUN
        steps = shared.of_specimens_at(z, STEPS, count).reshape(-1, PARTS_OF_RUN)
        after = np.cumsum(steps, axis=1) - steps  # in part k are the steps after the parts before it
        return np.asarray(after[self.specimen, self.part_of_run])

    def is_after(self, step: int) -> BoolArray:
        """Tests (N,) of the specimen of a step, by its index, that come after it."""
        number, part = divmod(step, PARTS_OF_RUN)
        return np.asarray((self.specimen == number) & (self.part_of_run > part))

    def by_drift(self, shared: Shared) -> FloatArray:
        """Derivatives of Re and Im of log `drifted` by the shared values (N, 2, p), per stated uncertainty."""
        change, block = np.zeros((self.place.size, len(shared)), dtype=complex), self.block(shared)
        for kind, unit in DRIFTS.items():
            for place, number in shared.of_kind(kind):
                change[:, place] = np.where(self.specimen == number, unit * self.place, 0.0)
        for kind, unit in BLOCKS.items():
            for place, number in shared.of_kind(kind):
                change[:, place] = np.where(block == number, unit, 0.0)
        for kind, unit in STEPS.items():
            for place, number in shared.of_kind(kind):
                change[:, place] = unit * self.is_after(number)
        for place, _ in shared.of_kind(Kind.AMPLITUDE):
            change[:, place] = self.deflection
        return parts(np.asarray(change * shared.std), axis=1)

    def ends(self, shared: Shared, z: FloatArray, stiffness: ComplexArray) -> Ends:
        """The springs and masses of the specimens of K* (N,) [N/m]; those without a belt are massless."""
        if not shared.has_belts:
            return massless(stiffness)
        return ends_of(stiffness, self.omega, *self.belts(shared, z), self.reference, self.rod)

    def belts(self, shared: Shared, z: FloatArray) -> tuple[FloatArray, ComplexArray, FloatArray]:
        """Mass [kg], log share [1] and exponent [1] of the belt of each test's specimen (N,); 0 where there is none."""
        counts = (int(self.specimen.max(initial=0)) + 1, int(self.family.max(initial=0)) + 1)
        mass, share, exponent = shared.belts_at(z, counts)
        return mass[self.specimen], share[self.family], exponent[self.specimen]

    def belt_columns(self, shared: Shared) -> Iterator[tuple[int, ComplexArray, int]]:
        """Each shared value of the belts: its place, its change (N,) of what it acts on, its place in `Ends.by`."""
        for kind, (unit, which) in BELTS.items():
            of = self.family if kind in OF_FAMILY else self.specimen
            for place, number in shared.of_kind(kind):
                yield place, np.where(of == number, unit * shared.parameters[place].std, 0.0), which


def whitening(covariance: FloatArray, amplitudes: ComplexArray, present: BoolArray) -> FloatArray:
    """W with W S W^T = 1: the inverse of the Cholesky factor of the covariance S."""
    both = np.repeat(present, 2, axis=-1)
    diagonal = np.arange(6)
    kept = np.where(both[:, :, None] & both[:, None, :], covariance, 0.0)
    kept[:, diagonal, diagonal] += np.where(both, (FLOOR * np.repeat(np.abs(amplitudes), 2, axis=-1)) ** 2, 1.0)
    # The matrix is scaled to a unit diagonal first, because forces and velocities differ much in size.
    scale = 1.0 / np.sqrt(kept[:, diagonal, diagonal])
    kept *= scale[:, :, None] * scale[:, None, :]
    inverse = np.linalg.inv(np.linalg.cholesky(kept))
    inverse *= np.where(both[:, :, None], scale[:, None, :], 0.0)
    return np.asarray(inverse)


#: Fields of `Linear` in the four directions that no drive changes.
_ROWS = ("residual", "by_stiffness", "by_impedance")


@dataclass(frozen=True, eq=False)
class Linear(ByValue):
    """Whitened residual and derivatives of some tests, in the four directions that no drive changes.

    Attributes
    ----------
    residual : (N, 4) float array
        Measured minus model.
    by_stiffness : (N, 4, 2) float array
        Derivatives of the model by Re and Im of log K*; 0 for rigid blocks.
    by_impedance : (N, 4, 2) float array
        Derivatives of the model by Re and Im of Zr [N s/m].
    drive : (N,) complex array [m/s]
        True V1, as estimated.
    impedance, ratio : (N,) complex arrays [N s/m], [1]
        Zr, and T = V2/V1.
    gains : (N, 3) complex array [1]
        Gains of F1, V1 and V2.
    ends : Ends
        The springs and masses of the specimens.
    predicted : (N, 3) complex array
        F1, V1, V2 as the channels would record them, by the model.
    basis : (N, 6, 4) float array
        The four directions among the whitened amplitudes, orthonormal. They turn with the parameters, and may flip.
    weigh : (N, 4, 4) float array, optional
        The symmetric M with M (1 + s² B B^T) M = 1 for the derivatives B by log K* and its scatter s; None without
        scatter. It is applied to residual and derivatives already.
    log_weight : (N,) float array, optional
        Logarithm of the determinant of `weigh`.
    unstated : dict, (N,) complex array
        Derivatives of Zr by the unstated parts, and of all by the impedance of spring and damper, of `unstated_parts`.
    observed, shared, z
        The tests and the shared values.
    """

    residual: FloatArray
    by_stiffness: FloatArray
    by_impedance: FloatArray
    drive: ComplexArray
    impedance: ComplexArray
    ratio: ComplexArray
    gains: ComplexArray
    ends: Ends
    predicted: ComplexArray
    basis: FloatArray
    unstated: tuple[Mapping[tuple[str, int], ComplexArray], ComplexArray]
    observed: Observed
    shared: Shared
    z: FloatArray
    weigh: FloatArray | None = None
    log_weight: FloatArray | None = None

    @cached_property
    def by_shared(self) -> FloatArray:
        """Derivatives (N, 4, p) of the model by the shared values, per stated standard uncertainty."""
        turn = np.swapaxes(self.basis, 1, 2) if self.weigh is None else self.weigh @ np.swapaxes(self.basis, 1, 2)
        change = _by_channels(self)
        if self.shared.has_belts:
            change += _by_belts(self)
        by_shared = whitened(turn @ self.observed.whiten, change)
        by_shared += self.by_impedance @ parts(self.impedance_by_shared, axis=1)
        return np.asarray(by_shared + self.by_stiffness @ self.observed.by_drift(self.shared))

    @cached_property
    def impedance_by_shared(self) -> ComplexArray:
        """Derivatives (N, p) of Zr by the shared values [N s/m], per stated standard uncertainty."""
        return _impedance_by_shared(self.observed, self.shared, self.z, *self.unstated)

    def field(self, name: str) -> np.ndarray:
        """A field by its name; one in the four directions is returned in the six of the whitened amplitudes."""
        values: np.ndarray = getattr(self, name)
        return np.einsum("nij,nj...->ni...", self.basis, values) if name in _ROWS else values

    def scattered(self, scatter: FloatArray) -> Linear:
        """The same tests, whose log K* scatters by `scatter` (N,), in Re and in Im."""
        if not np.any(scatter):
            return self
        by_k = self.by_stiffness * scatter[:, None, None]
        square = np.eye(2) + np.swapaxes(by_k, 1, 2) @ by_k
        a, b, d = square[:, 0, 0], square[:, 0, 1], square[:, 1, 1]
        size = np.sqrt(a * d - b**2)
        root = (square + size[:, None, None] * np.eye(2)) / np.sqrt(a + d + 2 * size)[:, None, None]
        weigh = np.eye(4) - by_k @ inverse_of_two(root + square) @ np.swapaxes(by_k, 1, 2)
        weighed = weigh @ np.concatenate([self.residual[:, :, None], self.by_stiffness, self.by_impedance], axis=2)
        parts_of = dict(zip(_ROWS, (weighed[:, :, 0], weighed[:, :, 1:3], weighed[:, :, 3:]), strict=True))
        return replace(self, weigh=weigh, log_weight=-np.log(size), **parts_of)


def linearise(observed: Observed, shared: Shared, z: FloatArray, stiffness: ComplexArray) -> Linear:
    """The model and its derivatives at shared values z, and at K* of each test [N/m] in the middle of its run."""
    jw = 1j * observed.omega
    stiffness = stiffness * observed.drifted(shared, z)
    rig, gains = shared.rig_at(z), observed.gains(shared, z)
    added = observed.added(shared.masses_at(z)) - np.where(observed.rigid, rig.tyre_mass, 0.0)
    impedance = np.asarray(rig.impedance(observed.omega, added))
    extra, through_frame = shared.extra_at(z), np.ones(1, dtype=complex)
    by_part: dict[tuple[str, int], ComplexArray] = {}
    if extra:
        speed = np.abs(observed.amplitudes[:, 2])
        beside, by_part, through_frame = unstated_parts(observed.omega, rig, speed, observed.rigid, extra)
        impedance = impedance + beside
    ends = observed.ends(shared, z, stiffness)
    spring, beyond = ends.spring, impedance + np.where(observed.rigid, 0.0, jw * ends.wheel)
    input_mass = rig.input_mass + extra.get(("input", 0), 0.0) + np.where(observed.rigid, 0.0, ends.contact)
    ratio = np.where(observed.rigid, 1.0, spring / (spring + jw * beyond))
    by_zr = np.where(observed.rigid, 0.0, -jw * spring / (spring + jw * beyond) ** 2)

    unit = _three(beyond * ratio + jw * input_mass, 1.0, ratio) * gains
    rotation, triangle = np.linalg.qr(_both(observed.whiten, unit), mode="complete")
    rotated = np.swapaxes(rotation, 1, 2) @ observed.whiten  # a drive is in the first two rows alone
    share, rest = whitened(rotated[:, :2], observed.amplitudes[..., None]), rotated[:, 2:]
    drive = (inverse_upper(triangle[:, :2]) @ share)[..., 0] @ np.array([1, 1j])

    scaled, predicted = gains * drive[:, None], unit * drive[:, None]
    log_k = _by_ends(observed.omega, beyond, ratio, by_zr, ends.by[:, 0]) * scaled
    zr = _three(np.where(observed.rigid, 1.0, ratio**2), 0.0, by_zr) * scaled
    changes = whitened(rest, np.stack([observed.amplitudes - predicted, log_k, 1j * log_k, zr, 1j * zr], axis=-1))
    return Linear(
        residual=changes[:, :, 0],
        by_stiffness=changes[:, :, 1:3],
        by_impedance=changes[:, :, 3:],
        drive=drive,
        impedance=impedance,
        ratio=ratio,
        gains=gains,
        ends=ends,
        predicted=predicted,
        basis=rotation[:, :, 2:],
        unstated=(by_part, through_frame),
        observed=observed,
        shared=shared,
        z=z,
    )


def _by_ends(
    omega: FloatArray, beyond: ComplexArray, ratio: ComplexArray, by_zr: ComplexArray, by: ComplexArray
) -> ComplexArray:
    """Derivatives (N, 3) of F1, V1 and V2 by what changes the logarithm of the spring, and both masses, as `by` (N, 3).

    `beyond` is the impedance beyond the spring, with the mass at the wheel.
    """
    spring, contact, wheel = by.T
    of_spring, wheel = ratio * (1 - ratio) * spring, 1j * omega * wheel
    return _three(beyond * of_spring + ratio**2 * wheel + 1j * omega * contact, 0.0, of_spring + by_zr * wheel)


def _impedance_by_shared(
    observed: Observed,
    shared: Shared,
    z: FloatArray,
    by_part: Mapping[tuple[str, int], ComplexArray],
    through_frame: ComplexArray,
) -> ComplexArray:
    """Derivatives of Zr by z (N, p) [N s/m]; the last two are `Linear.unstated`."""
    gradient, extra = shared.rig_at(z).impedance_gradient(observed.omega), shared.extra_at(z)
    change = np.zeros((observed.omega.size, len(shared)), dtype=complex)
    for place, index in shared.of_role(Role.RIG):
        of = shared.parameters[place].source.of
        change[:, place] = gradient[:, index]
        if of in _SUPPORT:
            change[:, place] *= through_frame
        if of == "preload_stiffness":
            change[:, place] += extra.get(("loss", 0), 0.0) / observed.omega
        if of == "tyre_mass":
            change[observed.rigid, place] = 0.0
    for place, index in shared.of_role(Role.UNSTATED):
        change[:, place] = by_part.get((shared.parameters[place].source.of, index), 0.0)
    for place, index in shared.of_role(Role.MASS):
        change[:, place] = np.where(observed.mass_at == index, gradient[:, -1], 0.0)
    return np.asarray(change * shared.std)


def _by_belts(linear: Linear) -> ComplexArray:
    """Derivatives of the three amplitudes by z (N, 3, p), through the mass and the springs of the specimens."""
    observed, shared, ends = linear.observed, linear.shared, linear.ends
    change = np.zeros((len(linear.predicted), 3, len(shared)), dtype=complex)
    tyre, jw = ~observed.rigid, 1j * observed.omega
    scaled = linear.gains * np.where(tyre, linear.drive, 0.0)[:, None]
    beyond = linear.impedance + jw * ends.wheel
    by_zr = -jw * ends.spring / (ends.spring + jw * beyond) ** 2
    for place, turn, which in observed.belt_columns(shared):
        own = np.flatnonzero(turn)  # the tests of one specimen, or of one condition
        at = (observed.omega[own], beyond[own], linear.ratio[own], by_zr[own])
        change[own, :, place] = _by_ends(*at, ends.by[own, which]) * scaled[own] * turn[own, None]
    return change


def _by_channels(linear: Linear) -> ComplexArray:
    """Derivatives of the three amplitudes by z (N, 3, p), for fixed Zr and K*."""
    observed, shared, predicted = linear.observed, linear.shared, linear.predicted
    of = shared.of_channel
    change = np.zeros((len(predicted), 3, len(shared)), dtype=complex)
    places = np.flatnonzero(of)
    index = shared.index[places]
    channels = observed.channels[index]
    change[:, channels, places] = observed.turns[:, index] * (predicted[:, channels] * shared.std[places])
    for place in shared.of_input_mass:
        drive = linear.gains[:, 0] * linear.drive
        change[:, 0, place] = shared.parameters[place].std * 1j * observed.omega * drive
    return change


def _three(force: ComplexArray, motion: float, beyond: ComplexArray) -> ComplexArray:
    """Complex values of F1, V1 and V2 (N, 3), from those of F1 and V2 (N,) and one value of V1."""
    values = np.full((beyond.size, 3), motion, dtype=complex)
    values[:, 0], values[:, 2] = force, beyond
    return values


def whitened(whiten: FloatArray, values: ComplexArray) -> FloatArray:
    """Complex changes (N, 3, k) of the amplitudes, as Re and Im in turn, by a matrix (N, m, 6): (N, m, k)."""
    return np.matmul(whiten, parts(values, axis=2).reshape(len(values), 6, -1))


def _both(whiten: FloatArray, values: ComplexArray) -> FloatArray:
    """Whitened derivatives (N, m, 2) by Re and Im of a quantity, from the complex derivatives (N, 3)."""
    return whitened(whiten, np.stack([values, 1j * values], axis=-1))


def cholesky_qr(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Q and R of (N, m, 2) columns, by one Cholesky step."""
    upper = upper_factor(np.swapaxes(columns, 1, 2) @ columns)
    return columns @ inverse_upper(upper), upper


def upper_factor(gram: FloatArray) -> FloatArray:
    """R with R^T R = G for matrices G (..., 2, 2); R is 1 for columns that are zero."""
    a, b, d = gram[..., 0, 0], gram[..., 0, 1], gram[..., 1, 1]
    idle = (a <= 0) | (d <= 0)
    a, d = np.where(idle, 1.0, a), np.where(idle, 1.0, d)
    r00 = np.sqrt(a)
    r01 = np.where(idle, 0.0, b / r00)
    r11 = np.sqrt(np.maximum(d - r01**2, 1e-14 * d))
    return _upper(r00, r01, r11)


def inverse_upper(upper: FloatArray) -> FloatArray:
    """Inverse of (..., 2, 2) upper triangles."""
    a, b, d = upper[..., 0, 0], upper[..., 0, 1], upper[..., 1, 1]
    return _upper(1 / a, -b / (a * d), 1 / d)


def _upper(first: FloatArray, across: FloatArray, second: FloatArray) -> FloatArray:
    """Upper triangles (..., 2, 2) of their entries (...,)."""
    matrix = np.zeros((*first.shape, 2, 2))
    matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 1] = first, across, second
    return matrix


def projected(frame: FloatArray, columns: FloatArray) -> FloatArray:
    """Columns (N, m, k) without the directions of `frame`, which are projected out twice for full accuracy."""
    for _ in range(2):
        columns = columns - frame @ (np.swapaxes(frame, 1, 2) @ columns)
    return columns
