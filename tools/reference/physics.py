"""Vibrating networks with 50 digits: Newton's law at each node, solved as one linear system.

No closed formula of a tyre, a four-pole or a rig stands here. A part is a mass at a node or a complex stiffness between
two nodes; a frequency gives one system of equations, and all quantities are read off its solution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mpmath import matrix, mp, mpc, mpf

mp.dps = 60

#: The imaginary unit, and the numbers of a case by their names.
J = mpc(0, 1)
Numbers = Mapping[str, mpf]


def turning(values: Numbers) -> mpf:
    """Angular frequency [rad/s]."""
    return 2 * mp.pi * values["frequency"]


class Network:
    """Masses and springs of complex stiffness at one frequency; the node None is the ground."""

    def __init__(self, omega: mpf) -> None:
        self.omega = omega
        self._places: dict[str, int] = {}
        self._parts: list[tuple[str, str | None, mpc]] = []

    def mass(self, node: str, value: mpf) -> Network:
        """A mass [kg] at a node: it needs the force -w^2 m x."""
        return self.link(node, None, -(self.omega**2) * value)

    def damper(self, one: str, other: str | None, value: mpf) -> Network:
        """A viscous damper [N s/m] between two nodes."""
        return self.link(one, other, J * self.omega * value)

    def link(self, one: str, other: str | None, stiffness: mpc) -> Network:
        """A spring of complex stiffness [N/m] between two nodes."""
        for node in (one, other):
            if node is not None:
                self._places.setdefault(node, len(self._places))
        self._parts.append((one, other, stiffness))
        return self

    def balance(self) -> tuple[matrix, dict[str, int]]:
        """Dynamic stiffness matrix: forces on the nodes over their displacements, and the place of each node."""
        count = len(self._places)
        found = matrix(count, count)
        for one, other, stiffness in self._parts:
            ends = [(self._places[one], 1)] + ([(self._places[other], -1)] if other is not None else [])
            for row, sign in ends:
                for column, turn in ends:
                    found[row, column] += sign * turn * stiffness
        return found, dict(self._places)

    def displacements(self, forces: Mapping[str, mpc]) -> dict[str, mpc]:
        """Complex displacement [m] of each node under forces [N]."""
        whole, places = self.balance()
        right = matrix(len(places), 1)
        for node, force in forces.items():
            right[places[node]] = force
        solved = mp.lu_solve(whole, right)
        return {node: solved[at] for node, at in places.items()}


def with_tyre(net: Network, values: Numbers, near: str, far: str | None) -> Network:
    """A tyre between two nodes: a known complex stiffness, or the spring K1 beside K2 and C in series."""
    if "Re K*" in values:
        return net.link(near, far, mpc(values["Re K*"], values["Im K*"]))
    net.link(near, far, values["K1"])
    return net.link(near, "inside the arm", values["K2"]).damper("inside the arm", far, values["C"])


def stiffness_of(values: Numbers, omega: mpf) -> mpc:
    """K* [N/m] of a tyre that stands on the ground: force over displacement."""
    return 1 / with_tyre(Network(omega), values, "contact", None).displacements({"contact": mpf(1)})["contact"]


def with_rig(net: Network, values: Numbers, node: str) -> Network:
    """The rig above a node: masses, the preload spring with its damper and its loss, and the frame behind it."""
    zero = mpf(0)
    net.mass(node, values["m"] + values.get("tyre mass", zero) + values.get("added mass", zero))
    spring = values["K3"] * (1 + J * values.get("preload loss factor", zero))
    foot = "frame" if "frame stiffness" in values else None
    net.link(node, foot, spring).damper(node, foot, values.get("c3", zero))
    return net if foot is None else net.link(foot, None, values["frame stiffness"])


def amplitudes(values: Numbers, *, blocked: bool = False) -> tuple[mpc, mpc, mpc]:
    """F1 [N], V1 and V2 [m/s] of a tyre on its rig, driven by 1 N at the force cell."""
    omega = turning(values)
    net = with_tyre(Network(omega), values, "contact", None if blocked else "wheel")
    net.mass("contact", values.get("input mass", mpf(0)))
    if not blocked:
        with_rig(net, values, "wheel")
    moved = net.displacements({"contact": mpf(1)})
    return mpf(1), J * omega * moved["contact"], J * omega * moved.get("wheel", mpf(0))


def rig_impedance(values: Numbers) -> mpc:
    """Force over velocity at the rig, without a tyre [N s/m]."""
    omega = turning(values)
    moved = with_rig(Network(omega), values, "wheel").displacements({"wheel": mpf(1)})
    return 1 / (J * omega * moved["wheel"])


def four_pole(net: Network, first: str, last: str) -> matrix:
    """The four-pole between two nodes: (F1, V1) over (F2, V2), from two loads at the output."""
    whole, places = net.balance()
    count, found = len(places), matrix(2, 2)
    for column, (force, speed) in enumerate(((1, 0), (0, 1))):
        # unknown: F1 and all displacements but that of the output, which is given by its speed
        at = speed / (J * net.omega)
        free = [node for node in places if node != last]
        system, right = matrix(count, count), matrix(count, 1)
        for node, row in places.items():
            for place, other in enumerate(free, start=1):
                system[row, place] = whole[row, places[other]]
            system[row, 0] = -1 if node == first else 0
            right[row] = -whole[row, places[last]] * at - (force if node == last else 0)
        solved = mp.lu_solve(system, right)
        found[0, column] = solved[0]
        moved = at if first == last else solved[1 + free.index(first)]
        found[1, column] = J * net.omega * moved
    return found


def solved(forward: Callable[..., tuple[mpf, ...]], wanted: tuple[mpf, ...], start: tuple[mpf, ...]) -> tuple[mpf, ...]:
    """Positive unknowns for which a forward calculation gives the wanted values; Newton in logarithms."""
    logs, step = [mp.log(one) for one in start], mpf(10) ** -30
    count = len(logs)

    def off(at: list[mpf]) -> matrix:
        return matrix(forward(*(mp.exp(one) for one in at))) - matrix(wanted)

    for _ in range(60):
        here, slopes = off(logs), matrix(count, count)
        for column in range(count):
            moved = [one + step * (at == column) for at, one in enumerate(logs)]
            slopes[:, column] = (off(moved) - here) / step
        move = mp.lu_solve(slopes, here)
        largest = max(abs(one) for one in move)
        shrink = min(mpf(1), 1 / largest) if largest else mpf(1)
        logs = [one - shrink * change for one, change in zip(logs, move, strict=True)]
        if largest < mpf(10) ** -56:
            return tuple(mp.exp(one) for one in logs)
    raise ArithmeticError("the network could not be solved for its parts")
