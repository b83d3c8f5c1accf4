"""Networks of masses and springs as a state space; linear ones are solved by the exact exponential of its matrix.

The displacement of the node `contact` is prescribed. The node `ground` moves `base` times as much. Every other node has
a mass. Displacements and forces are positive from the contact towards the foundation; the time factor is e^{+jwt}.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Free oscillations are left to decay to this share before a cycle counts as steady.
SETTLED = 1e-13
#: Rate of the internal time grid of random excitation and sweeps [Hz].
GRID = 4096


@dataclass(frozen=True)
class Link:
    """What connects two nodes.

    Attributes
    ----------
    first, second : str
        Nodes; the force pushes the second one if the first one moves towards it.
    stiffness, damping : float [N/m], [N s/m]
    arms : tuple of (float [N/m], float [s])
        Maxwell arms: stiffness and relaxation time.
    track : tuple of float, optional [N/m], [kg], [N s/m]
        Fluid in a channel: stiffness of the chamber, effective mass and damping of the fluid.
    slip : tuple of (float [N/m], float [m])
        Elements that slip: stiffness, and deflection at which the force is the largest.
    """

    first: str
    second: str
    stiffness: float = 0.0
    damping: float = 0.0
    arms: tuple[tuple[float, float], ...] = ()
    track: tuple[float, float, float] | None = None
    slip: tuple[tuple[float, float], ...] = ()

    def dynamic_stiffness(self, omega: Array) -> ComplexArray:
        """Force over deflection (...,) [N/m] at angular frequencies (...,) [rad/s], without what slips."""
        s = 1j * np.asarray(omega, dtype=float)
        value = self.stiffness + s * self.damping
        for stiffness, time in self.arms:
            value = value + stiffness * s * time / (1 + s * time)
        if self.track is not None:
            chamber, mass, damping = self.track
            value = value + 1 / (1 / chamber + 1 / (s * s * mass + s * damping))
        return value


@dataclass(frozen=True)
class Network:
    """Masses [kg] by node, links, and the motion of the ground over that of the contact [1]."""

    masses: dict[str, float]
    links: tuple[Link, ...]
    base: float = 0.0
    #: Node whose motion is the output; the links that end there give the force behind the specimen.
    output: str = "wheel"

    def state_space(self) -> StateSpace:
        """Its matrices."""
        return StateSpace(self)


@dataclass
class StateSpace:
    """States z: (x, v) of each node, the damper of each arm, (x, v) of each fluid, deflection of each slipping element.

    ``rates`` (n, n + 3) is the derivative of z by z and by x1, v1, a1; ``outputs`` (4, n + 3) gives x1, F1, x2 and the
    force behind the specimen.
    ``slips`` has for each slipping element its state, its largest deflection, and the row of its velocity.
    """

    network: Network
    rates: Array = field(init=False)
    outputs: Array = field(init=False)
    slips: list[tuple[int, float, Array]] = field(init=False)

    def __post_init__(self) -> None:
        free = [node for node in self.network.masses if node not in ("contact", "ground")]
        extra = [len(link.arms) + 2 * (link.track is not None) + len(link.slip) for link in self.network.links]
        size = 2 * len(free) + sum(extra)
        self.size = size
        unit = np.eye(size + 3)
        x1, v1, a1 = unit[size:]
        position = {"contact": x1, "ground": self.network.base * x1}
        velocity = {"contact": v1, "ground": self.network.base * v1}
        position |= {node: unit[2 * at] for at, node in enumerate(free)}
        velocity |= {node: unit[2 * at + 1] for at, node in enumerate(free)}
        forces = {node: np.zeros(size + 3) for node in (*position,)}
        rates, behind = np.zeros((size, size + 3)), np.zeros(size + 3)
        self.slips, place = [], 2 * len(free)
        for link in self.network.links:
            x = position[link.first] - position[link.second]
            v = velocity[link.first] - velocity[link.second]
            force = link.stiffness * x + link.damping * v
            for stiffness, time in link.arms:
                rates[place] = (x - unit[place]) / time
                force = force + stiffness * (x - unit[place])
                place += 1
            if link.track is not None:
                chamber, mass, damping = link.track
                push = chamber * (x - unit[place])
                rates[place] = unit[place + 1]
                rates[place + 1] = (push - damping * unit[place + 1]) / mass
                force = force + push
                place += 2
            for stiffness, largest in link.slip:
                rates[place] = v
                force = force + stiffness * unit[place]
                self.slips.append((place, largest, v))
                place += 1
            forces[link.first] = forces[link.first] - force
            forces[link.second] = forces[link.second] + force
            if link.second == self.network.output:
                behind = behind + force
        for at, node in enumerate(free):
            rates[2 * at] = unit[2 * at + 1]
            rates[2 * at + 1] = forces[node] / self.network.masses[node]
        drive = self.network.masses.get("contact", 0.0) * a1 - forces["contact"]
        self.rates = rates
        self.outputs = np.array([x1, drive, position[self.network.output], behind])

    def transfer(self, omega: Array) -> ComplexArray:
        """Outputs over x1 (N, 4) at angular frequencies (N,) [rad/s]; what slips counts as sticking."""
        s = 1j * np.atleast_1d(omega)[:, None]
        drive = np.concatenate([s**0, s, s**2], axis=1)
        by_state, by_drive = self.rates[:, : self.size], self.rates[:, self.size :]
        matrix = s[:, :, None] * np.eye(self.size) - by_state
        states = np.linalg.solve(matrix, (drive @ by_drive.T)[:, :, None])[:, :, 0] if self.size else drive[:, :0]
        return states @ self.outputs[:, : self.size].T + drive @ self.outputs[:, self.size :].T

    def decay_time(self) -> float:
        """Time after which free oscillations are below `SETTLED` [s]."""
        if not self.size:
            return 0.0
        slowest = -np.linalg.eigvals(self.rates[:, : self.size]).real.max()
        if slowest <= 0:
            raise ValueError("a part of the laboratory is not damped: its free oscillations do not decay")
        return float(-np.log(SETTLED) / slowest)


def powers(matrix: Array, start: Array, count: int) -> Array:
    """States (count, n) of a linear recursion, start first, by doubling."""
    states = start[None, :]
    step = matrix
    while len(states) < count:
        states = np.concatenate([states, states @ step.T])
        step = step @ step
    return states[:count]


def steady_cycle(space: StateSpace, frequencies: Array, amplitudes: ComplexArray, period: float, count: int) -> Array:
    """Outputs (count, 4) over one period of a steady motion of sines.

    Parameters
    ----------
    space : StateSpace
        Without slipping elements.
    frequencies : (L,) float array [Hz]
        Multiples of 1/period.
    amplitudes : (L,) complex array [m]
        x1 = Re sum a e^{jwt}.
    period : float [s]
    count : int
        Samples of the period.
    """
    size, lines = space.size, len(frequencies)
    matrix = np.zeros((size + 2 * lines, size + 2 * lines))
    drive = np.zeros((3, 2 * lines))
    start = np.zeros(size + 2 * lines)
    for at, (frequency, amplitude) in enumerate(zip(frequencies, amplitudes, strict=True)):
        omega, here = 2 * np.pi * frequency, slice(2 * at, 2 * at + 2)
        place = slice(size + 2 * at, size + 2 * at + 2)
        matrix[place, place] = [[0.0, -omega], [omega, 0.0]]
        drive[:, here] = [[1.0, 0.0], [0.0, -omega], [-(omega**2), 0.0]]
        start[place] = amplitude.real, amplitude.imag
    matrix[:size, :size] = space.rates[:, :size]
    matrix[:size, size:] = space.rates[:, size:] @ drive
    # The solution after whole periods, block by block: no norm of a matrix becomes large.
    one = expm(matrix * period / count)
    cycle = np.linalg.matrix_power(one, count)
    state = start
    for _ in range(int(np.ceil(np.log2(max(space.decay_time() / period, 1.0)))) + 1):
        state = np.concatenate([(cycle @ state)[:size], start[size:]])
        cycle = cycle @ cycle
    states = powers(one, state, count)
    return states[:, :size] @ space.outputs[:, :size].T + states[:, size:] @ (space.outputs[:, size:] @ drive).T


def steady_period(spaces: Sequence[StateSpace], commands: Array, corner: float) -> Array:
    """Outputs (R, N, 4) over one period of a command (R, N) on the grid, through an actuator of this corner [Hz].

    The command is linear between the points of the grid, and the response to it is exact. The states of several
    recordings are stepped together.
    """
    poles = 2 * np.pi * corner * np.exp(1j * np.pi * (2 * np.arange(4) + 5) / 8)
    companion = np.poly(poles).real
    steps, outs = [], []
    for space in spaces:
        size = space.size
        matrix = np.zeros((size + 6, size + 6))
        matrix[:size, : size + 3] = space.rates
        matrix[size : size + 3, size + 1 : size + 4] = np.eye(3)
        matrix[size + 3, size : size + 4] = -companion[:0:-1]
        matrix[size + 3, size + 4] = companion[-1]
        matrix[size + 4, size + 5] = 1.0
        steps.append(expm(matrix / GRID))
        outs.append(np.concatenate([space.outputs, np.zeros((4, 3))], axis=1))
    step, out = np.array(steps), np.array(outs)
    slope = (np.roll(commands, -1, axis=1) - commands) * GRID
    count = commands.shape[1]
    found = np.empty((count, len(spaces), step.shape[1]))
    drive = np.stack([commands, slope], axis=2).transpose(1, 0, 2)
    state = np.zeros((len(spaces), step.shape[1], 1))
    # The period is run from rest; what is left at its end gives the state that returns to itself, for the second run.
    for keep in (False, True):
        for at in range(count):
            state[:, -2:, 0] = drive[at]
            if keep:
                found[at] = state[:, :, 0]
            state = step @ state
        if not keep:
            own = step[:, :-2, :-2]
            whole = np.eye(own.shape[1]) - np.linalg.matrix_power(own, count)
            state[:, :-2] = np.linalg.solve(whole, state[:, :-2])
    return np.einsum("rij,trj->rti", out, found)
