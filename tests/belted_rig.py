"""A rig with a belted tyre, in nodes: contact, belt, wheel; solved by elimination, sharing no formula with the package.

Rigid blocks or the tyre stand between the force cell and a mass on a spring with a damper. Sensors are off.
"""

from dataclasses import dataclass, field

import numpy as np

from fourpole.core.allpoles import Setups
from fourpole.core.phasor import Phasors


@dataclass
class BeltedRig:
    """The truth, in SI."""

    belt: float = 7.0
    k_contact: float = 348e3
    k_rim: float = 1740e3
    loss: float = 0.08
    active: float = 0.0  # share of the force by which the wheel feels more of the belt than the belt of the wheel
    moving_mass: float = 22.0
    k_rig: float = 12.44e3
    c_rig: float = 45.0
    input_mass: float = 0.0
    wheel_mass: float = 0.0
    gains: tuple = (1.05 * np.exp(-0.052j), 0.95 * np.exp(0.04j), 1.03 * np.exp(0.03j))
    delays: tuple = (2e-4, 0.0, 1e-4)
    remounted: dict = field(default_factory=dict)  # factor of V1 by test number

    def springs(self, omega):
        """Both springs with a modulus and a loss that rise with frequency."""
        shape = (omega / (2 * np.pi * 10)) ** (2 / np.pi * np.arctan(self.loss)) * np.exp(1j * np.arctan(self.loss))
        return self.k_contact * shape, self.k_rim * shape

    def specimen(self, omega):
        """Forces on contact and wheel over their motions (2, 2): the belt's node is eliminated."""
        c, r = self.springs(omega)
        whole = np.array([[c, -c, 0], [-c, c + r - omega**2 * self.belt, -r], [0, -r * (1 + self.active), r]])
        if self.belt == 0.0 and self.active == 0.0:
            k = 1 / (1 / c + 1 / r)
            return np.array([[k, -k], [-k, k]])
        ends = [0, 2]
        return whole[np.ix_(ends, ends)] - np.outer(whole[ends, 1], whole[1, ends]) / whole[1, 1]

    def test(self, omega, mass, *, rigid):
        """F1, V1 and V2 as recorded, for a motion of the contact of 1 mm."""
        x1 = 1e-3
        rig = self.k_rig + 1j * omega * self.c_rig - omega**2 * self.moving_mass
        if rigid:
            x2, force = x1, (rig - omega**2 * mass) * x1
        else:
            d = self.specimen(omega)
            beyond = rig - omega**2 * (mass + self.wheel_mass)
            x2 = -d[1, 0] * x1 / (d[1, 1] + beyond)
            force = d[0, 0] * x1 + d[0, 1] * x2
        force -= omega**2 * self.input_mass * x1
        true = np.array([force, 1j * omega * x1, 1j * omega * x2])
        return true * np.array(self.gains) * np.exp(-1j * omega * np.array(self.delays))

    def recorded(
        self, frequencies, *, blocks=(6.0, 20.0), loads=(0.0, 12.0), repeats=1, noise=0.0, jitter=0.0, seed=0,
        masses_off=None,
    ):  # fmt: skip
        """Phasors and setups of all tests; `noise` is relative, `jitter` the relative scatter of the frequency."""
        rng = np.random.default_rng(seed)
        rows, found, covariance, of_f = [], [], [], []
        for number, nominal in enumerate(frequencies):
            for rigid, masses in ((True, blocks), (False, loads)):
                for mass in list(masses) * repeats:
                    f = nominal * (1 + jitter * rng.uniform(-1, 1))
                    off = (masses_off or {}).get(mass, 0.0)
                    exact = self.test(2 * np.pi * f, mass + off, rigid=rigid)
                    exact[1] *= self.remounted.get(len(rows), 1.0)
                    std = noise * np.abs(exact)
                    drawn = exact + std * (rng.standard_normal(3) + 1j * rng.standard_normal(3))
                    rows.append((rigid, mass, number))
                    found.append(drawn)
                    covariance.append(np.diag(np.repeat(std, 2) ** 2))
                    of_f.append(f)
        rigid, mass, group = (np.array(column) for column in zip(*rows, strict=True))
        count = np.zeros(len(rows))
        phasors = Phasors(np.array(of_f), np.array(found), np.array(covariance), count, count + np.inf)
        return phasors, Setups(rigid, mass, 2e-4 * mass, group)

    def truth(self, frequencies):
        """k11, k12, k21, k22 (F, 2, 2)."""
        return np.array([self.specimen(2 * np.pi * f) for f in frequencies])

    def write(self, folder, frequencies, *, blocks=(6.0, 20.0), loads=(0.0, 12.0), noise=1e-3, seed=0, statement=""):
        """A campaign folder with recordings of 2 s at 1.5 kHz; `noise` is that of a sample over the amplitude."""
        rng, time = np.random.default_rng(seed), np.arange(3000) / 1500.0
        (folder / "recordings").mkdir(parents=True)
        units = {"time": ("t", "s"), "force_in": ("F1", "N"), "motion_in": ("V1", "m/s"), "motion_out": ("V2", "m/s")}
        channels = [f'{role} = {{ column = "{name}", unit = "{unit}" }}' for role, (name, unit) in units.items()]
        rig = ["[rig]", 'moving_mass = "22 kg"', 'preload_stiffness = "12 kN/m"', statement]
        lines = [*rig, "[channels]", *channels, "[tyres.car]"]
        (folder / "campaign.toml").write_text("\n".join(lines) + "\n")
        rows = [
            "test,file,kind,tyre,pressure [bar],preload [N],frequency [Hz],added_mass [kg],u(added_mass) [kg],mounting"
        ]
        for kind, letter, masses in (("calibration", "B", blocks), ("dynamic", "D", loads)):
            for number, mass in enumerate(masses):
                for f in frequencies:
                    name = f"{letter}{number + 1}-{f:g}"
                    size = 0.1 * self.test(2 * np.pi * f, mass, rigid=kind == "calibration")
                    waves = (size * np.exp(2j * np.pi * f * time)[:, None]).real
                    waves += noise * np.abs(size) * rng.standard_normal(waves.shape)
                    table = np.column_stack([time, waves])
                    file = folder / "recordings" / f"{name}.csv"
                    np.savetxt(file, table, "%.9g", ",", header="t,F1,V1,V2", comments="")
                    state = "car,2.2,4000" if kind == "dynamic" else ",,"
                    rows.append(f"{name},recordings/{name}.csv,{kind},{state},{f:g},{mass:g},{2e-4 * mass:g},once")
        (folder / "tests.csv").write_text("\n".join(rows) + "\n")
        return folder
