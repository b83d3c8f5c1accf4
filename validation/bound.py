"""The Cramér-Rao bound of a campaign, by a dense Fisher matrix at its truth: nothing of the estimator is used."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from laboratories import Case
from numpy.typing import NDArray

from fourpole.virtual.phasor_rig import CHANNELS, RIG_VALUES

__all__ = ["bounds"]

Array = NDArray[np.float64]

#: Central differences of relative step 1e-5: the error, the square of it, is far below what the bound is used for.
_STEP = 1e-5


def bounds(case: Case) -> dict[str, Array]:
    """Least standard uncertainty of each output of each test (N,), and of each shared value (1,), by its name.

    Unknown are the drive of each test, log K* of each condition and what the laboratory states with an uncertainty;
    the statements are prior knowledge.
    """
    model = _Model(case)
    jacobian = _by(model.amplitudes, model.size)
    fisher = jacobian.T @ jacobian
    fisher[np.diag_indices(len(model.names))] += 1.0
    scale = 1 / np.sqrt(np.diag(fisher))
    covariance = np.linalg.inv(fisher * scale * scale[:, None]) * scale * scale[:, None]
    gradient = _by(model.outputs, model.size).reshape(-1, case.family.size, model.size)
    found = {}
    for name, by in zip(model.output_names, gradient, strict=True):
        variance = np.einsum("np,pq,nq->n", by, covariance, by)
        found[name] = np.sqrt(variance + (model.by_k1(name) * case.k1_std) ** 2)
    shared = np.sqrt(np.diag(covariance)[: len(model.names)]) * model.std
    return found | {name: shared[at : at + 1] for at, name in enumerate(model.names)}


def _by(function: Callable[[Array], Array], size: int) -> Array:
    columns = []
    for at in range(size):
        step = np.zeros(size)
        step[at] = _STEP
        columns.append((function(step) - function(-step)) / (2 * _STEP))
    return np.stack(columns, axis=1)


class _Model:
    """Whitened amplitudes, and outputs, as functions of all that is unknown, 0 at the truth."""

    output_names = ("K'", "K''", "loss factor", "K2", "C", "TR")

    def __init__(self, case: Case) -> None:
        self.case, laboratory, truth = case, case.laboratory, case.campaign.truth
        self.omega = case.campaign.phasors.omega
        self.rigid = case.family < 0
        self.true = {name: float(getattr(truth, name)) for name in RIG_VALUES}
        self.gains = (1 + truth.gain) * np.exp(1j * truth.phase)
        stated = {name: getattr(laboratory, name)[1] for name in RIG_VALUES}
        stated |= {f"gain {c}": std for c, std in zip(CHANNELS, laboratory.std_gain, strict=True)}
        stated |= {f"phase {c}": std for c, std in zip(CHANNELS, laboratory.std_phase, strict=True)}
        masses = sorted(set(case.added_mass.tolist()) - {0.0})
        stated |= {f"added mass {mass:g} kg": laboratory.std_added * mass for mass in masses}
        self.names = [name for name, std in stated.items() if std > 0]
        self.std = np.array([stated[name] for name in self.names])
        self.added = np.array([truth.added_mass[mass] for mass in case.added_mass.tolist()])
        self.condition = self._conditions()
        self.count = int(self.condition.max()) + 1
        self.drive = case.campaign.true_amplitudes[:, 1]
        sigma = np.sqrt(np.diagonal(case.campaign.phasors.covariance, axis1=1, axis2=2))
        self.weight = np.where(sigma > 0, 1 / np.where(sigma > 0, sigma, 1.0), 0.0)

    @property
    def size(self) -> int:
        return len(self.names) + 2 * self.count + 2 * self.omega.size

    def _conditions(self) -> NDArray[np.int64]:
        """Tests of a family that are nearer in frequency than two of its nominal ones can be."""
        label, at = np.full(self.omega.size, -1), -1
        last = (-1, 0.0)
        for test in np.lexsort((self.omega, self.case.family)):
            here = (int(self.case.family[test]), float(self.omega[test]))
            if here[0] < 0:
                continue
            if here[0] != last[0] or here[1] > 1.007 * last[1]:
                at, last = at + 1, here
            label[test] = at
        return label

    def _state(self, x: Array) -> tuple[dict[str, float], NDArray[np.complex128], NDArray[np.complex128]]:
        """The rig's values, K* and Zr of each test."""
        z = x[: len(self.names)] * self.std
        moved = dict(zip(self.names, z.tolist(), strict=True))
        rig = {name: value + moved.get(name, 0.0) for name, value in self.true.items()}
        log_k = x[len(self.names) :][: 2 * self.count].reshape(-1, 2) @ [1, 1j]
        k = np.where(self.rigid, 1.0, self.case.campaign.stiffness) * np.where(
            self.rigid, 1.0, np.exp(log_k)[self.condition]
        )
        s = 1j * self.omega
        added = self.added + np.array([moved.get(f"added mass {mass:g} kg", 0.0) for mass in self.case.added_mass])
        mass = rig["moving_mass"] + added + np.where(self.rigid, 0.0, rig["tyre_mass"])
        leaf = rig["preload_stiffness"] * (1 + 1j * rig["preload_loss_factor"]) + s * rig["preload_damping"]
        return rig, k, s * mass + 1 / (s / leaf + s / rig["frame_stiffness"])

    def amplitudes(self, x: Array) -> Array:
        """Re and Im of F1, V1, V2 of each test, over their noise; one row of all."""
        rig, k, impedance = self._state(x)
        moved = dict(zip(self.names, (x[: len(self.names)] * self.std).tolist(), strict=True))
        turn = np.array([moved.get(f"gain {c}", 0.0) + 1j * moved.get(f"phase {c}", 0.0) for c in CHANNELS])
        v1 = self.drive * np.exp(x[-2 * self.omega.size :].reshape(-1, 2) @ [1, 1j])
        v2 = np.where(self.rigid, v1, v1 * k / (k + 1j * self.omega * impedance))
        f1 = impedance * v2 + 1j * self.omega * rig["input_mass"] * v1
        all_three = np.stack([f1, v1, v2], axis=1) * self.gains * np.exp(turn)
        parts = np.stack([all_three.real, all_three.imag], axis=2).reshape(-1, 6)
        return np.asarray((parts * self.weight).ravel())

    def outputs(self, x: Array) -> Array:
        _, k, impedance = self._state(x)
        arm = 1 / (k - np.where(self.rigid, 0.5, self.case.k1))
        tr = np.abs(k / (k + 1j * self.omega * impedance))
        k2, c = 1 / arm.real, -1 / np.where(self.rigid, 1.0, self.omega * arm.imag)
        return np.concatenate([k.real, k.imag, k.imag / k.real, k2, c, tr])

    def by_k1(self, name: str) -> Array:
        k, k1 = np.where(self.rigid, 2.0, self.case.campaign.stiffness), np.where(self.rigid, 1.0, self.case.k1)
        step = 1e-5 * k1
        above, below = (1 / (k - k1 - side * step) for side in (1, -1))
        if name == "K2":
            return np.asarray((1 / above.real - 1 / below.real) / (2 * step))
        if name == "C":
            above, below = above - 1j * self.rigid, below - 1j * self.rigid  # a block has none
            return np.asarray((1 / below.imag - 1 / above.imag) / (2 * step) / self.omega)
        return np.zeros(k1.size)
