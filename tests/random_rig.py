"""A rig under random excitation, simulated by its frequency responses: no function of the package takes part."""

from __future__ import annotations

import numpy as np

K1, K2, C = 120e3, 90e3, 800.0
MASS, SPRING = 15.0, 12440.0


def stiffness(omega):
    """K* of the specimen [N/m]: K1 beside K2 in series with C."""
    return K1 + 1j * omega * C * K2 / (K2 + 1j * omega * C)


def white(rng, size):
    """Complex Gaussian noise of unit power."""
    return (rng.normal(size=size) + 1j * rng.normal(size=size)) / np.sqrt(2)


def answered(motion, rate, count, *, noise=0.0, seed=0, damping=20.0):
    """Time [s], F1 [N], V1 and V2 [m/s] that a motion V1 from rest makes, with white noise."""
    rng, size = np.random.default_rng(seed), 2 * motion.size
    omega = 2 * np.pi * np.maximum(np.fft.rfftfreq(size, 1 / rate), 1e-9)
    rig = 1j * omega * MASS + SPRING / (1j * omega) + damping
    contact = np.fft.rfft(motion, size)
    force = contact / (1 / rig + 1j * omega / stiffness(omega))
    wheel = force / rig
    force[0] = wheel[0] = 0.0
    signals = [np.fft.irfft(one, size)[:count] for one in (force, contact, wheel)]
    return np.arange(count) / rate, *(one + noise * one.std() * rng.normal(size=count) for one in signals)


def run(seed, *, coherence=0.99, common=0.0, length=60.0, rate=1000.0, added=0.0, band=(3.0, 230.0)):
    """Time [s], F1 [N], V1 and V2 [m/s] of a record cut out of a longer one, with noise in each channel.

    The noises have the share `common` of their power in common. Each pair of channels has the coherence asked for.
    """
    rng = np.random.default_rng(seed)
    size, count = 2 * int(length * rate), int(length * rate)
    frequency = np.fft.rfftfreq(size, 1 / rate)
    omega = 2 * np.pi * np.maximum(frequency, 1e-9)
    rig = 1j * omega * (MASS + added) + SPRING / (1j * omega)
    motion = white(rng, frequency.size) * ((frequency > band[0]) & (frequency < band[1])) / (1 + frequency / 40)
    force = motion / (1 / rig + 1j * omega / stiffness(omega))
    clean = [np.fft.irfft(one, size)[:count] for one in (force, motion, force / rig)]
    clean = [one * (300.0 / clean[0].std()) for one in clean]
    share = 1 / np.sqrt(coherence) - 1
    shared = white(rng, count // 2 + 1)
    signals = []
    for one in clean:
        size_of = np.abs(np.fft.rfft(one))
        smooth = np.sqrt(np.convolve(size_of**2, np.ones(401) / 401, "same"))
        noise = np.sqrt(1 - common) * white(rng, size_of.size) + np.sqrt(common) * shared
        signals.append(one + np.sqrt(share) * np.fft.irfft(noise * smooth, count))
    return np.arange(count) / rate, *signals
