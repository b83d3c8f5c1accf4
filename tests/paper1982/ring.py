"""An inflated ring as a chain of point masses: stretch, bending, gas and springs as one energy, no shell theory."""

import numpy as np

NODES = 1440


def forces(x, p, radius, width, membrane, bending, springs):
    """Gradient (N, 2) of the energy at places (N, 2): chords under tension, turning angles, gas, radial springs."""
    h = 2 * radius * np.sin(np.pi / NODES)
    tension = p * width * radius * np.cos(np.pi / NODES)
    stiff = membrane * width / h
    d = np.roll(x, -1, axis=0) - x
    long = np.linalg.norm(d, axis=1)[:, None]
    pull = (stiff * (long - h) + tension) * d / long
    found = np.roll(pull, 1, axis=0) - pull
    found -= (
        0.5
        * p
        * width
        * np.stack(  # of the area of the polygon
            [np.roll(x[:, 1], -1) - np.roll(x[:, 1], 1), np.roll(x[:, 0], 1) - np.roll(x[:, 0], -1)], axis=1
        )
    )
    before = np.roll(d, 1, axis=0)
    turn = np.arctan2(before[:, 0] * d[:, 1] - before[:, 1] * d[:, 0], np.sum(before * d, axis=1))
    moment = (bending * width / h * (turn - 2 * np.pi / NODES))[:, None]
    by_after = moment * np.stack([-d[:, 1], d[:, 0]], axis=1) / long**2
    back = np.linalg.norm(before, axis=1)[:, None]
    by_before = -moment * np.stack([-before[:, 1], before[:, 0]], axis=1) / back**2
    found += np.roll(by_after, 1, axis=0) - by_after
    found += by_before - np.roll(by_before, -1, axis=0)
    out = np.linalg.norm(x, axis=1)[:, None]
    return found + springs * width * 2 * np.pi * radius / NODES * (out - radius) * x / out


def ring(omega, p, radius, width, membrane, bending, springs, mass, tau, length):
    """K* (N,) [N/m] and static stiffness of the ring under a load that is uniform over `length`.

    All nodes are alike: the forces after a move of the first one are a column of a circulant matrix of 2 x 2 blocks in
    the local directions, outward and around, which a Fourier transform makes block diagonal.
    """
    angle = 2 * np.pi * np.arange(NODES) / NODES
    outward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    around = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    given = (p, radius, width, membrane, bending, springs)
    x, step = radius * outward, 1e-7 * radius
    assert np.abs(forces(x, *given)).max() < 1e-6 * p * width * radius  # the inflated ring is in equilibrium
    blocks = np.zeros((NODES, 2, 2))
    for at, way in enumerate((outward, around)):
        move = np.zeros((NODES, 2))
        move[0] = step * way[0]
        change = (forces(x + move, *given) - forces(x - move, *given)) / (2 * step)
        blocks[:, 0, at], blocks[:, 1, at] = np.sum(change * outward, axis=1), np.sum(change * around, axis=1)
    waves = np.fft.fft(blocks, axis=0)
    half = length / (2 * radius) * NODES / (2 * np.pi)  # in cells
    cell = np.minimum(np.arange(NODES), NODES - np.arange(NODES))
    share = np.clip(half - cell + 0.5, 0.0, 1.0)
    weight = np.abs(np.fft.fft(share / share.sum())) ** 2 / NODES
    own = mass * width * 2 * np.pi * radius / NODES * np.eye(2)

    def yields(lossy):
        return np.sum(weight * np.linalg.inv(lossy)[:, 0, 0])

    moving = [yields(waves * (1 + 1j * w * tau) - w**2 * own) for w in omega]
    return 1 / np.array(moving), 1 / yields(waves).real
