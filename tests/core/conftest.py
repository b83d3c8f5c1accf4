"""Recordings and load cycles whose truth is known, made without any function under test."""

import numpy as np
import pytest
from hypothesis import settings
from tests.selection import EVERY

from fourpole.core.recording import Channel, Recording

settings.register_profile("busy", deadline=None, max_examples=100 if EVERY else 50)  # a busy machine is no failure
settings.load_profile("busy")

GAPS = {
    "none": lambda u: 0.0 * u,
    "friction": lambda u: 1.0 + 0.0 * u,
    "parabola": lambda u: 1.0 - u**2,
    "skewed": lambda u: (1.0 - u**2) * (1.0 + 0.5 * u),
    "ellipse": lambda u: np.sqrt(np.maximum(1.0 - u**2, 0.0)),
}


@pytest.fixture(scope="session")
def record():
    """Record F1, V1, V2 given by their amplitudes at the middle of the record."""

    def make(
        amplitudes,
        frequency,
        *,
        rate=1000.0,
        samples=2000,
        quantities=("force", "velocity", "velocity"),
        delays=(0.0, 0.0, 0.0),
        extra=0.0,
    ):
        """`amplitudes` [N], [m/s], [m/s], one row per harmonic; `extra` (3, samples) is added in recorded units."""
        rows = np.atleast_2d(amplitudes)
        time = (np.arange(samples) - 0.5 * (samples - 1)) / rate
        power = {"displacement": -1, "velocity": 0, "acceleration": 1, "force": 0}
        names = ("force_in", "motion_in", "motion_out")
        channels = {}
        for i, name in enumerate(names[: rows.shape[1]]):
            signal = np.zeros(samples)
            for k, amplitude in enumerate(rows[:, i], start=1):
                omega = 2 * np.pi * k * frequency
                signal += (
                    amplitude * (1j * omega) ** power[quantities[i]] * np.exp(1j * omega * (time - delays[i]))
                ).real
            channels[name] = [signal, quantities[i], delays[i]]
        added = np.broadcast_to(extra, (len(channels), samples))
        return Recording(
            rate, {name: Channel(s + add, q, d) for (name, (s, q, d)), add in zip(channels.items(), added, strict=True)}
        )

    return make


@pytest.fixture(scope="session")
def load_cycles():
    """Deflection and load of cycles between 0 and a depth about a mean law, with a gap of known shape."""

    def make(
        law, *, depth=0.03, cycles=3, up=201, down=201, warp=1.0, gap=200.0, shape="parabola", first=1.0, zero=0.0
    ):
        """`gap` [N] is half that of the branches; `warp` spaces the two branches differently; `first` scales a load."""
        u = np.concatenate([np.linspace(0, 1, up) ** warp, (1 - np.linspace(0, 1, down)) ** (1 / warp)])
        side = np.repeat([1.0, -1.0], [up, down])
        load = law(depth * u) + side * gap * GAPS[shape](2 * u - 1)
        scales = np.array([first] + [1.0] * (cycles - 1))
        return np.tile(depth * u, cycles) + zero, (scales[:, None] * load).ravel()

    return make
