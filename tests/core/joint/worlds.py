"""Laboratories drawn from the table of components, by a simulator that shares no formula with the package."""

from dataclasses import dataclass

import numpy as np

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.components import COMPONENTS, SpecimenUncertainty
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind

CHANNELS = ("F1", "V1", "V2")
TABLE = {row.kind: row for row in COMPONENTS}
#: The rows of the table that every dynamic test of a massless specimen has, and those that a laboratory leaves
#: unstated.
DYNAMIC = tuple(kind for kind, row in TABLE.items() if row.std > 0 and row.group not in ("linearity", "belt"))
ORDINARY = tuple(kind for kind in DYNAMIC if kind not in (Kind.GAIN, Kind.PHASE))
#: Unit sizes of errors that are absent unless a world has them; of the channel's root mean square for cross-talk.
ASKED = {
    "cross-talk": 1e-3, "gain drift": 2e-3, "loss": 5e-3, "frame": 5e-3, "mass": 1e-2, "input": 3e-3,
    "amplitude": 5e-3, "scatter": 3e-4, "step of a gain": 1e-3, "step of K*": 1e-3, "one test": 1e-3, "mode": 2e-3,
}  # fmt: skip
ENLARGED = {TABLE[kind].group: [one for one in DYNAMIC if TABLE[one].group == TABLE[kind].group] for kind in DYNAMIC}
#: Groups of which a world can have one member at several times its size.
GROUPS = (*ENLARGED, *ASKED)
#: Rigs as stated, with their specimens: mass [kg], spring [N/m], K' [N/m], loss factor, and range of frequency [Hz].
PLACES = {
    "tyre": (15.0, 12440.0, 2e5, 0.10, (10.0, 24.0)),
    "soft": (40.0, 5000.0, 4e5, 0.08, (8.0, 60.0)),
    "mount": (20.0, 20000.0, 2e6, 0.08, (21.0, 185.0)),
}


@dataclass(frozen=True)
class Design:
    """The tests of a laboratory: all specimens without a mass, and the first `carriers` with each of the masses [kg].

    `mounted` is the place of V1: specimen, drive or rig; `by_mass`: tests are sorted by mass, then by specimen.
    """

    rig: str = "tyre"
    masses: tuple[float, ...] = (10.0,)
    carriers: int = 9
    specimens: int = 3
    frequencies: int = 5
    repeats: int = 1
    mounted: str = "specimen"
    simultaneous: bool = False
    by_mass: bool = True
    std_gain: float = TABLE[Kind.GAIN].std
    std_phase: float = TABLE[Kind.PHASE].std
    std_rig: float = 0.02
    std_added: float = 2e-3
    noise: float = 2e-4

    @property
    def sizes(self):
        """Standard deviation of each component; that of the mounting is at most half of gain and of phase."""
        sizes = {kind: row.std for kind, row in TABLE.items()} | {Kind.GAIN: self.std_gain, Kind.PHASE: self.std_phase}
        sizes[Kind.DELAY] = 2e-6 if self.simultaneous else sizes[Kind.DELAY]
        share = {"specimen": 1.0, "drive": 0.1, "rig": 0.0}[self.mounted]
        for kind, whole in ((Kind.MOUNTING_GAIN, self.std_gain), (Kind.MOUNTING_PHASE, self.std_phase)):
            sizes[kind] = share * min(sizes[kind], whole / 2)
        return sizes

    def tests(self, rng):
        """Frequency [Hz], number of the specimen, added mass [kg] and time [h] of each test."""
        grid = np.linspace(*PLACES[self.rig][4], self.frequencies) * (1 + 0.02 * rng.uniform(-1, 1, self.frequencies))
        all_blocks = [(mass, one) for mass in (0.0, *self.masses) for one in range(self.specimens)]
        blocks = [(mass, one) for mass, one in all_blocks if mass == 0 or one < self.carriers]
        blocks.sort(key=None if self.by_mass else lambda block: block[::-1])
        rows = [(f, one, mass) for mass, one in blocks for _ in range(self.repeats) for f in grid]
        frequency, specimen, added = (np.array(column) for column in zip(*rows, strict=True))
        return frequency, specimen.astype(int), added, 0.1 * np.arange(len(rows))


DESIGNS = {
    "tyre-one": Design(),
    "tyre-two": Design(masses=(5.0, 12.0), specimens=2, frequencies=6, simultaneous=True, by_mass=False),
    "tyre-five": Design(carriers=1, specimens=5, frequencies=4, repeats=2),
    "tyre-drive": Design(carriers=1, mounted="drive", std_added=5e-4),
    "tyre-small": Design(specimens=1, frequencies=3),
    "tyre-plain": Design(masses=(), repeats=2),
    "soft-one": Design("soft", specimens=2, frequencies=8),
    "soft-two": Design("soft", (5.0, 12.0), carriers=1, specimens=4, frequencies=6, repeats=2, mounted="rig"),
    "soft-drive": Design("soft", frequencies=7, mounted="drive", by_mass=False),
    "mount-one": Design("mount", specimens=2, frequencies=8, std_added=1e-3),
}


@dataclass(frozen=True)
class World:
    """Phasors with noise, the statement, and the truth: K*, TR, amplitudes without noise, sizes of the components."""

    design: Design
    phasors: Phasors
    rig: Rig
    channels: ChannelUncertainty
    specimens: SpecimenUncertainty
    specimen: list[str]
    k1: np.ndarray
    family: np.ndarray
    added_mass: np.ndarray
    time: np.ndarray
    stiffness: np.ndarray
    tr: np.ndarray
    recorded: np.ndarray
    cause: str
    parts: dict

    def keywords(self):
        """The statement as `solve_joint` takes it, besides phasors, rig and K1."""
        names = "family", "specimen", "specimens", "added_mass", "channels", "time"
        mounting = ["rig"] * self.time.size if self.design.mounted == "rig" else self.specimen
        more = {"added_mass_std": self.design.std_added * self.added_mass, "nominal_frequency": self.phasors.frequency}
        return {name: getattr(self, name) for name in names} | more | {"mounting": mounting}


def draw_world(rng, design, asked="", size=1.0, *, ordinary=True, stated=True, given=None):
    """A laboratory with its tests, and one member of the group `asked` (of `GROUPS`) at `size` times its unit.

    `ordinary`: whether ordinary parts exist; `stated`: whether the statement has them; `given` replaces components.
    """
    frequency, specimen, added, time = tests = design.tests(rng)
    masses, level = np.unique(added), PLACES[design.rig][2]
    none = dict.fromkeys(ORDINARY, 0.0)
    sizes, said = design.sizes | ({} if ordinary else none), design.sizes | ({} if stated else none)
    parts = _drawn(rng, sizes, design.specimens, masses.size) | dict.fromkeys(ASKED, 0.0)
    cause = _enlarge(rng, parts, asked, size, min(design.specimens, design.carriers)) if asked else ""
    parts |= given or {}
    moved = 1 + design.std_rig * rng.standard_normal(2)
    weight = (masses * (1 + design.std_added * rng.standard_normal(masses.size)))[np.searchsorted(masses, added)]
    after = (time > np.quantile(time, rng.uniform(0.25, 0.75))) + 0.0
    stiffness, true = _tested(rng, design, parts, tests, moved, weight, after)
    recorded, of_channel = _recorded(rng, parts, true, tests, after)
    amplitudes, covariance = _noisy(rng, recorded, design.noise)
    return World(
        design=design, phasors=Phasors(frequency, amplitudes, covariance, 0 * time, 0 * time + np.inf),
        **_statement(design, said, frequency.max()), specimen=[f"specimen {chr(65 + one)}" for one in specimen],
        k1=0.4 * level + 0 * time, family=specimen, added_mass=added, time=time, stiffness=stiffness,
        tr=np.abs(true[:, 2] / true[:, 1]), recorded=recorded, cause=cause + of_channel, parts=parts,
    )  # fmt: skip


#: Error of the angle that goes with one of the modulus.
_ANGLE = {
    Kind.GAIN: Kind.PHASE, Kind.BLOCK: Kind.ANGLE_BLOCK, Kind.DRIFT: Kind.ANGLE_DRIFT,
    Kind.MOUNTING_GAIN: Kind.MOUNTING_PHASE, Kind.REMOUNTING_GAIN: Kind.REMOUNTING_PHASE,
}  # fmt: skip
#: Channels F1, V1, V2 that are mounted anew with each specimen, and with each added mass.
_MOUNTED = {Kind.MOUNTING_GAIN: ("mounting", np.eye(3)[1]), Kind.REMOUNTING_GAIN: ("remounting", 1 - np.eye(3)[1])}


def _pair(sizes, kind):
    """Sizes of modulus and angle as one complex number."""
    return sizes[kind] + 1j * sizes[_ANGLE[kind]]


def _statement(design, said, top):
    """What the laboratory states, with the slope at the highest frequency [Hz]."""
    (mass, spring), (block, drift) = PLACES[design.rig][:2], (_pair(said, kind) for kind in (Kind.BLOCK, Kind.DRIFT))
    std = {"moving_mass": design.std_rig * mass, "preload_stiffness": design.std_rig * spring}
    std["preload_damping"] = said[Kind.RIG_VALUE] * 2 * np.sqrt(mass * spring)
    of_all = {"gain": Kind.GAIN, "phase": Kind.PHASE, "delay": Kind.DELAY, "low_cut": Kind.LOW_CUT}
    uncertain = {name: np.full(3, said[kind]) for name, kind in of_all.items()}
    uncertain |= {name: _pair(said, kind) * _MOUNTED[kind][1] for kind in _MOUNTED for name in _MOUNTED[kind][:1]}
    channels = ChannelUncertainty(**uncertain, slope=np.full(3, said[Kind.SLOPE] / top**2))
    rig = Rig(moving_mass=mass, preload_stiffness=spring, std=std)
    return {"rig": rig, "channels": channels, "specimens": SpecimenUncertainty(block, drift)}


def _drawn(rng, sizes, specimens, masses):
    """The truth of the table: a standard normal number times its size for every component; 0 is the first mass."""
    shapes = {Kind.MOUNTING_GAIN: (specimens, 3), Kind.REMOUNTING_GAIN: (masses, 3), Kind.RIG_VALUE: ()}
    shapes |= {Kind.BLOCK: (specimens, masses), Kind.DRIFT: (specimens,)}
    shapes |= {angle: shapes[kind] for kind, angle in _ANGLE.items() if kind in shapes}
    parts = {kind: sizes[kind] * rng.standard_normal(shapes.get(kind, (3,))) for kind in DYNAMIC}
    for kind, (_, where) in _MOUNTED.items():  # gain and phase of a channel contain what differs between its mountings
        for whole, part in ((Kind.GAIN, kind), (Kind.PHASE, _ANGLE[kind])):
            parts[part] = parts[part] * where
            parts[whole] = parts[whole] * np.sqrt(1 - (sizes[part] / sizes[whole]) ** 2 * where)
    return parts | {kind: parts[kind] * (np.arange(masses) > 0) for kind in (Kind.BLOCK, Kind.ANGLE_BLOCK)}


def _enlarge(rng, parts, asked, size, carriers):
    """Set one member of a group to `size` times its unit, within its bound; its name."""
    sign = 1.0 if asked in ("loss", "frame", "mass", "input", "scatter", "mode") else float(rng.choice([-1.0, 1.0]))
    if asked in ASKED:
        parts[asked] = ASKED[asked] * size * sign
        return asked
    kind = ENLARGED[asked][rng.integers(len(ENLARGED[asked]))]
    value, count = sign * min(size * TABLE[kind].std, TABLE[kind].bound), (*np.shape(parts[kind]), 1)[0]
    one, last = int(rng.integers(carriers if asked == "block" else count)), int(rng.choice([0, 2]))
    places = {"preload damping": (), "mounting": (one, 1), "remounting": (one, last), "block": (one, -1)}
    at = places.get(asked, (one,))
    parts[kind] = np.asarray(parts[kind])
    parts[kind][at] = value
    of = f"specimen {chr(65 + one)}" if asked in ("block", "drift") else CHANNELS[(1, *at)[-1]]
    return asked if asked == "preload damping" else kind.text + of


def _tested(rng, design, parts, tests, moved, weight, after):
    """True K* (N,) [N/m] and true F1, V1, V2 (N, 3) of each test."""
    (mass, spring, level, loss, _), (frequency, specimen, added, time) = PLACES[design.rig], tests
    jw, at, count = 2j * np.pi * frequency, np.searchsorted(np.unique(added), added), frequency.size
    middle = np.array([time[specimen == one].mean() for one in range(design.specimens)])
    place = (time - middle[specimen]) / np.ptp(time)
    block, drift = (_pair(parts, kind) for kind in (Kind.BLOCK, Kind.DRIFT))
    log_k = block[specimen, at] + drift[specimen] * place + parts["step of K*"] * after
    log_k = log_k + parts["scatter"] * (rng.standard_normal(count) + 1j * rng.standard_normal(count))
    of_each = np.exp(0.15 * rng.standard_normal((2, design.specimens)))[:, specimen]
    pace = frequency / frequency.mean()
    steady = level * of_each[0] * pace**0.05 * (1 + 1j * loss * of_each[1] * pace**0.3) * np.exp(log_k)
    leaf = spring * moved[1] * (1 + 1j * parts["loss"]) + jw * parts[Kind.RIG_VALUE] * 2 * np.sqrt(mass * spring)
    turn = frequency / np.median(frequency)  # a frame may resonate in the middle of the tests
    gives_way = (parts["frame"] + parts["mode"] / (1 - turn**2 + 0.04j * turn)) / spring
    zr = jw * (mass * (moved[0] + parts["mass"]) + weight) + leaf / (1 + leaf * gives_way) / jw
    drive = 0.1 * rng.uniform(0.7, 1.4, count) * np.exp(2j * np.pi * rng.random(count))
    bent = np.zeros(count)
    for _ in range(30):  # K* depends on the deflection, which depends on K*
        stiffness = steady * np.exp(parts["amplitude"] * bent)
        t = stiffness / (stiffness + jw * zr)
        deflection = np.log(np.abs(drive * (1 - t) / jw))
        bent = deflection - deflection.mean()
    return stiffness, drive[:, None] * np.stack([zr * t + jw * parts["input"] * mass, np.ones(count), t], axis=1)


def _recorded(rng, parts, true, tests, after):
    """Amplitudes (N, 3) by exact complex responses of the channels, and the channel with an added error in words."""
    frequency, specimen, added, time = tests
    f, at, (hit, other) = frequency[:, None], np.searchsorted(np.unique(added), added), rng.permutation(3)[:2]
    response = (1 + parts[Kind.GAIN]) * np.exp(1j * parts[Kind.PHASE] - 2j * np.pi * f * parts[Kind.DELAY])
    response = response * (1 + parts[Kind.SLOPE] * (f / f.max()) ** 2) / (1 - 1j * parts[Kind.LOW_CUT] / f)
    for kind, number in ((Kind.MOUNTING_GAIN, specimen), (Kind.REMOUNTING_GAIN, at)):
        response = response * ((1 + parts[kind]) * np.exp(1j * parts[_ANGLE[kind]]))[number]
    response[:, hit] *= 1 + parts["gain drift"] * (time - time.mean()) / np.ptp(time) + parts["step of a gain"] * after
    response[rng.integers(frequency.size), hit] *= 1 + parts["one test"]
    size, sensed = np.sqrt(np.mean(np.abs(true) ** 2, axis=0)), true.copy()
    sensed[:, hit] += parts["cross-talk"] * size[hit] / size[other] * true[:, other]
    of_hit = any(parts[name] for name in ("cross-talk", "gain drift", "step of a gain", "one test"))
    return sensed * response, f" {CHANNELS[other]} in" * bool(parts["cross-talk"]) + f" {CHANNELS[hit]}" * of_hit


def _noisy(rng, amplitudes, relative):
    """Amplitudes with circular noise that is correlated between the channels, and its covariance (N, 6, 6)."""
    normal = rng.standard_normal((4, len(amplitudes), 3, 3))
    mixed = np.eye(3) + 0.3 * (normal[0] + 1j * normal[1])
    mixed = mixed / np.linalg.norm(mixed, axis=2, keepdims=True) * relative * np.abs(amplitudes)[:, :, None]
    noise = (mixed @ (normal[2, :, :, :1] + 1j * normal[3, :, :, :1]))[:, :, 0] / np.sqrt(2)
    gamma = mixed @ np.conj(np.swapaxes(mixed, 1, 2)) / 2
    blocks = np.array([[gamma.real, -gamma.imag], [gamma.imag, gamma.real]])
    return amplitudes + noise, blocks.transpose(2, 3, 0, 4, 1).reshape(-1, 6, 6)
