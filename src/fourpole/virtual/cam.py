"""The cam that drives the dynamic rig: its motion is known at every instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray


@dataclass(frozen=True)
class Cam:
    r"""An eccentric disc with profile errors, which turns at an unsteady speed.

    .. math::

        x_1 = e\,\Bigl(\sin\theta + \sum_n a_n \sin(n\theta + \phi_n)\Bigr), \qquad
        \theta = \omega t + \sum_n \frac{r_n}{n}\sin(n\omega t + \psi_n)
                 + \frac{w\,\omega T}{2\pi}\sin(2\pi t/T + \psi_w)

    Parameters
    ----------
    frequency : float [Hz]
        Mean revolutions per second; > 0.
    eccentricity : float [m]
        e: amplitude of the motion.
    profile : tuple of (order, fraction [1], phase [rad])
        n, a_n and phi_n: harmonics of the profile, relative to the eccentricity.
    ripple : tuple of (order, fraction [1], phase [rad])
        n, r_n and psi_n: the speed varies by the fraction r_n, n times per revolution.
    wander, wander_period, wander_phase : float [1], [s], [rad]
        w, T, psi_w: the speed varies slowly by the fraction w. Its mean over whole periods is `frequency`.

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
        angle, speed, _ = self._turning(time)
        x, slope, _ = self._shape(angle)
        return self.eccentricity * x, self.eccentricity * slope * speed

    def acceleration(self, time: FloatArray) -> FloatArray:
        """Acceleration [m/s^2] of the contact at `time` [s].

        Examples
        --------
        >>> Cam(frequency=10.0).acceleration(np.array([0.025])).round(3).tolist()
        [-3.948]
        """
        angle, speed, rate = self._turning(time)
        _, slope, bend = self._shape(angle)
        return self.eccentricity * (bend * speed * speed + slope * rate)

    def _turning(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Angle [rad] of the cam and its first two derivatives by time [rad/s], [rad/s^2]."""
        omega = 2.0 * np.pi * self.frequency
        angle = omega * time
        speed = np.full_like(angle, omega)
        rate = np.zeros_like(angle)
        if self.ripple:
            turns = _multiples(angle, max(order for order, _, _ in self.ripple))
            for order, fraction, phase in self.ripple:
                part = turns[order - 1] * (fraction * np.exp(1j * phase))
                angle = angle + part.imag / order
                speed += omega * part.real
                rate -= order * omega * omega * part.imag
        if self.wander:
            slow = 2.0 * np.pi / self.wander_period
            angle = angle + self.wander * omega / slow * np.sin(slow * time + self.wander_phase)
            speed += self.wander * omega * np.cos(slow * time + self.wander_phase)
            rate -= self.wander * omega * slow * np.sin(slow * time + self.wander_phase)
        return angle, speed, rate

    def _shape(self, angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Profile relative to the eccentricity [1], and its first two derivatives by the angle."""
        turns = _multiples(angle, max((order for order, _, _ in self.profile), default=1))
        x, slope, bend = turns[0].imag.copy(), turns[0].real.copy(), -turns[0].imag
        for order, fraction, phase in self.profile:
            part = turns[order - 1] * (fraction * np.exp(1j * phase))
            x += part.imag
            slope += order * part.real
            bend -= order * order * part.imag
        return x, slope, bend


def _multiples(angle: FloatArray, highest: int) -> list[ComplexArray]:
    """e^{jna} for n = 1 ... highest, by multiplication, which is much faster than an exponential for each n."""
    first = np.empty(angle.shape, dtype=complex)
    first.real, first.imag = np.cos(angle), np.sin(angle)
    powers = [first]
    while len(powers) < highest:
        powers.append(powers[-1] * first)
    return powers
