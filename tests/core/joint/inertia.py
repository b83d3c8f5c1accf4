"""Laboratories whose specimens have inertia, by elimination of nodes: no formula of the package is used."""

from dataclasses import dataclass

import numpy as np

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig

TYRE = tuple(range(10, 25, 2))
WIDE = tuple(np.linspace(8.0, 60.0, 9))


@dataclass(frozen=True)
class Lab:
    """A specimen and a rig: belt [kg] with its first frequency [Hz], rim held; share of the springs, and their law.

    `law`: both springs of one law, a constant one at the rim, or the paper's arm in both. `second` is a further mass in
    the spring at the rim [kg], `rod` a mass that is spread along a specimen of stiffness `k` [N/m]; of few `slices` the
    masses have the inertia of an even one to first order. `frame` has the
    stiffness [N/m] and the mass [kg] of a frame behind the preload spring, which nobody states.
    """

    belt: float = 7.0
    mode: float = 80.0
    share: float = 0.2
    law: str = "one"
    frequencies: tuple = TYRE
    masses: tuple = (0.0, 10.0)
    rig: tuple = (15.0, 12440.0)
    conditions: int = 1
    k: float = 0.0
    rod: float = 0.0
    slices: int = 400
    second: float = 0.0
    std: tuple = (0.007, 0.005, 1e-4)
    sensors: tuple = (0.005, np.deg2rad(0.1))
    noise: float = 2e-4
    frame: tuple = ()

    def springs(self, frequency, condition):
        """Stiffness at the contact and at the rim [N/m]."""
        rim = self.belt * (2 * np.pi * self.mode) ** 2 if not self.k else self.k * (1 + self.share) / self.share
        rim, power = rim * (1 + 0.25 * condition), (frequency / 10) ** 0.03 * (1 + 0.08j)
        if self.law == "one":
            return self.share * rim * power, rim * power
        if self.law == "rim":
            return self.share * rim * power, rim * (1 + 0.02j)
        arm = 0.6 + 1 / (1 / 0.9 + 1 / (0.004j * 2 * np.pi * frequency))
        return self.share * rim * arm, rim * arm

    def test(self, frequency, condition, wheel):
        """K* of the springs, F1 over x1, and x2 over x1; `wheel` is the rig's stiffness at the wheel [N/m]."""
        contact, rim = self.springs(frequency, condition)
        square = (2 * np.pi * frequency) ** 2
        stiffness = 1 / (1 / contact + 1 / rim)
        if self.rod:
            slices = self.slices
            unit, beside = np.diag(np.r_[1, 2 * np.ones(slices - 1), 1]), np.eye(slices + 1, k=1)
            ends = slices * stiffness * (unit - beside - beside.T)
            inner = np.full(slices - 1, slices / (slices - 1))
            weights = np.r_[0.5, inner, 0.5] * self.rod / (slices + 1)
            whole = ends - square * np.diag(weights) + 0j
        elif self.second:
            half = 2 * rim
            whole = np.array([[contact, -contact, 0, 0], [-contact, contact + half, -half, 0],
                              [0, -half, 2 * half, -half], [0, 0, -half, half]])  # fmt: skip
            whole = whole - square * np.diag([0, self.belt, self.second, 0])
        else:
            whole = np.array([[contact, -contact, 0], [-contact, contact + rim, -rim], [0, -rim, rim]])
            whole = whole - square * np.diag([0, self.belt, 0])
        whole[-1, -1] += wheel
        moved = np.linalg.solve(whole[1:, 1:], -whole[1:, 0])
        return stiffness, whole[0, 0] + whole[0, 1:] @ moved, moved[-1]

    def draw(self, seed):
        """Phasors, rig, keywords of `solve_joint`, K* of the springs [N/m] and TR of each test."""
        rng = np.random.default_rng(seed)
        rows = [(c, m, f) for m in self.masses for c in range(self.conditions) for f in self.frequencies]
        condition, added, frequency = np.array(rows).T
        mass, spring = np.array(self.rig) * (1 + np.array(self.std[:2]) * rng.standard_normal(2))
        weighed = added * (1 + self.std[2] * rng.standard_normal())
        omega = 2 * np.pi * frequency
        leaf = spring + 20j * omega
        if self.frame:
            behind = self.frame[0] * (1 + 0.05j) - omega**2 * self.frame[1]
            leaf = leaf * behind / (leaf + behind)
        wheel = leaf - omega**2 * (mass + weighed)
        rows = zip(frequency, condition, wheel, strict=True)
        stiffness, force, ratio = np.array([self.test(*row) for row in rows]).T
        amplitudes = 0.06 * np.stack([force / (1j * omega), np.ones(omega.size), ratio], axis=1)
        gain, phase = self.sensors
        amplitudes = amplitudes * np.exp(gain * rng.standard_normal(3) + 1j * phase * rng.standard_normal(3))
        std = self.noise * np.sqrt(np.mean(np.abs(amplitudes) ** 2, axis=0))
        amplitudes = amplitudes + std * (
            rng.standard_normal(amplitudes.shape) + 1j * rng.standard_normal(amplitudes.shape)
        )
        covariance = np.tile(np.diag(np.repeat(std, 2) ** 2), (omega.size, 1, 1))
        phasors = Phasors(frequency, amplitudes, covariance, 0 * omega, 0 * omega + np.inf)
        std = {"moving_mass": self.std[0] * self.rig[0], "preload_stiffness": self.std[1] * self.rig[1]}
        rig = Rig(*self.rig, preload_damping=20.0, std=std | {"preload_damping": 0.5})
        keywords = {
            "family": condition.astype(int), "nominal_frequency": frequency, "added_mass": added,
            "added_mass_std": self.std[2] * added,
            "channels": ChannelUncertainty(np.full(3, gain), np.full(3, phase)),
        }  # fmt: skip
        return phasors, rig, keywords, stiffness, np.abs(ratio)


LABS = {
    "car": Lab(),
    "car, constant rim": Lab(law="rim"),
    "car, the paper's loss": Lab(law="paper"),
    "car to 60 Hz": Lab(frequencies=WIDE),
    "car to 60 Hz, constant rim": Lab(frequencies=WIDE, law="rim"),
    "car at three pressures": Lab(conditions=3),
    "car, one mass": Lab(masses=(0.0,)),
    "car, one mass, three frequencies": Lab(masses=(0.0,), frequencies=(10.0, 16.0, 24.0)),
    "kart": Lab(belt=1.2, mode=95.0),
    "truck": Lab(belt=40.0, mode=60.0, rig=(60.0, 60e3), masses=(0.0, 30.0)),
    "mount": Lab(
        rod=0.4, k=3e5, share=1.0, rig=(5.0, 2e4), masses=(0.0, 3.0), frequencies=tuple(np.linspace(10, 140, 9))
    ),
    "massless": Lab(belt=0.0, k=2e5),
}
