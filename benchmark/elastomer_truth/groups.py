"""Which faults the recordings of a campaign cannot tell apart, by the generator's own likelihood.

The phasors of all dynamic tests are a function of the laboratory. Unknown are the drive of each test, K* of each
condition, and what the statement gives with an uncertainty, which counts as prior knowledge. A fault moves the phasors;
the part of this that no unknown explains is its mark. Two faults are alike if the mark of the one, scaled, misses that
of the other by less than the noise. If the mark of a fault is below the noise, the recordings do not show it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import deepcopy

import numpy as np

from elastomer_truth.faults import FAULTS, apply_fault
from elastomer_truth.laboratory import Laboratory, Test, Value
from elastomer_truth.mechanics import Array, ComplexArray
from elastomer_truth.recording import amplitudes

#: The ratios of each test, and the noise of all.
_Base = tuple[list[ComplexArray], Array]
#: Largest chi-square of a mark that is not seen, or of the difference of two that are alike.
UNSEEN = 9.0
#: Standard uncertainties of errors of a channel that nobody states.
_USUAL = {"gain": 0.01, "phase": 0.009, "delay": 2e-5, "low_cut": 0.05, "slope": 1e-3}
#: Relative step of derivatives.
_STEP = 1e-6
#: Part of a fault that gives its derivative.
_PART = 1e-5


def groups(lab: Laboratory) -> dict[str, tuple[str, ...]]:
    """Causes, as "cause channel", that the recordings cannot tell from each linear fault of a campaign, by its name.

    A fault of the static tests moves K1 alone, so no recording shows it: its group is "none". Faults that are not the
    same in all tests, and those of a filled rubber, are in no group.
    """
    static = {fault.name: ("none",) for fault in lab.faults if fault.cause.startswith("static")}
    linear = [fault for fault in lab.faults if fault.linear]
    if not linear or any(one.slip for one in lab.specimens.values()):
        return static
    plain = deepcopy(lab)
    _without_faults(plain, lab)
    tests = _dynamic(plain)
    noise = _noise(plain, tests)
    base = _ratios(plain, tests), noise
    projector = _unknowns(plain, tests, base)
    marks = {}
    for name, (_, _, sizes, _, where, same) in FAULTS.items():
        if same and where(plain):
            marks[name] = _remain(projector, _moved(plain, tests, base, name, sizes[0]))
    found: dict[str, tuple[str, ...]] = {**static}
    for fault in linear:
        mark = _remain(projector, _moved(plain, tests, base, fault.name, fault.size))
        alike = []
        for name, other in marks.items():
            size = float(mark @ other) / max(float(other @ other), 1e-300)
            miss = mark - size * other
            if name != fault.name and float(mark @ mark) < UNSEEN:
                continue
            if name != fault.name and float(miss @ miss) < UNSEEN:
                alike.append(f"{FAULTS[name][0]} {FAULTS[name][1]}")
        if float(mark @ mark) < UNSEEN:
            alike.append("none")
        found[fault.name] = tuple(dict.fromkeys(alike))
    return found


def _without_faults(plain: Laboratory, lab: Laboratory) -> None:
    """Take the linear faults out again: the statement is the place at which the likelihood is linear."""
    plain.faults = []
    for value in plain.values.values():
        if value.stated is not None:
            value.true = value.stated
    for name in [fault.name for fault in lab.faults]:
        if name in ("soft frame", "input mass", "base motion", "guide friction"):
            for key in {"soft frame": ("frame stiffness", "frame mass", "frame damping")}.get(name, (name,)):
                if plain.values[key].stated is None:
                    plain.values.pop(key)
    plain.values.pop("guide friction", None)
    if plain.added_mass.stated:
        plain.added_mass.true = plain.added_mass.stated
    for sensor in plain.sensors.values():
        sensor.flaws = {}
        for value in (sensor.gain, sensor.phase, sensor.delay, sensor.low_cut, sensor.slope):
            value.true = value.stated or 0.0
    for test in plain.tests:
        test.flaws, test.file_of, test.true, test.factors = {}, "", {}, (1.0, 1.0)


def _lines(test: Test) -> Array:
    return np.array([test.frequency]) if test.kind == "sine" else np.geomspace(*(test.band or (1.0, 2.0)), 12)


def _ratios(lab: Laboratory, tests: list[Test]) -> list[ComplexArray]:
    """F1/V1 and V2/V1 of all lines (L, 2), of each test."""
    each = [amplitudes(lab, test, _lines(test)) for test in tests]
    return [found[:, _used(lab)] / found[:, 1:2] for found in each]


def _change(lab: Laboratory, tests: list[Test], base: _Base) -> Array:
    """Change of the logarithms of the ratios, real and imaginary parts (N,), over their noise."""
    logs = [np.log(ratio / before) for ratio, before in zip(_ratios(lab, tests), base[0], strict=True)]
    return np.concatenate([np.stack([log.real, log.imag]).ravel() for log in logs]) / base[1]


def _noise(lab: Laboratory, tests: list[Test]) -> Array:
    """Standard deviations (N,) of the logarithms by the noise of the sensors."""
    parts = []
    for test in tests:
        size = np.abs(amplitudes(lab, test, _lines(test))) * test.amplitude
        share = np.stack([_std(lab, test, role) for role in ("F1", "V1", "V2")])[None, :] / np.maximum(size, 1e-300)
        std = np.sqrt(share[:, _used(lab)] ** 2 + share[:, 1:2] ** 2 + 1e-8)
        parts.append(np.stack([std, std]).ravel())
    return np.concatenate(parts)


def _used(lab: Laboratory) -> list[int]:
    return [0] if lab.blocked else [0, 2]


def _std(lab: Laboratory, test: Test, role: str) -> float:
    """Standard deviation of the amplitude of a sine, or of a line of many [SI]."""
    if role not in lab.sensors:
        return 0.0
    sensor = lab.sensors[role]
    step = 2 * sensor.full_scale / 2 ** (lab.bits or 24)
    noise = np.hypot(sensor.noise, step / np.sqrt(12))
    return float(noise * np.sqrt(2 / (test.duration * lab.rate)) * (1.0 if test.kind == "sine" else 6.0))


def _moved(lab: Laboratory, tests: list[Test], base: _Base, name: str, size: float) -> Array:
    """Change of the phasors by a fault; of a soft fixture by its derivative.

    A fixture of some size is one with a specimen, and what K* cannot explain of it is its square alone.
    """
    part = _PART if name == "soft fixture" else 1.0
    faulty = deepcopy(lab)
    apply_fault(faulty, name, part * size, np.random.default_rng(0))
    keep = {test.name for test in tests}
    return _change(faulty, [test for test in faulty.tests if test.name in keep], base) / part


def _unknowns(lab: Laboratory, tests: list[Test], base: _Base) -> tuple[Array, Array]:
    """Columns (N, p) by which the unknowns move the phasors, and the weights (p,) of what is known of them before."""
    columns, weights = [], []
    # K* of a condition moves the lines of its tests, and those of no other one.
    owners = _owners(lab, tests)
    conditions = list(dict.fromkeys(owners))
    number = np.array([conditions.index(owner) for owner in owners])
    for factors in ((1 + _STEP, 1.0), (1.0, 1 + _STEP)):
        other = deepcopy(lab)
        for test in other.tests:
            test.factors = factors
        moved = _change(other, _dynamic(other), base) / _STEP
        columns += [np.where(number == at, moved, 0.0) for at in range(len(conditions))]
        weights += [0.0] * len(conditions)
    for find, std in _errors(lab):
        other = deepcopy(lab)
        find(other).true += 0.01 * std
        columns.append(_change(other, _dynamic(other), base) / 0.01)
        weights.append(1.0)
    return np.stack(columns, axis=1), np.array(weights)


def _errors(lab: Laboratory) -> Iterator[tuple[Callable[[Laboratory], Value], float]]:
    """Each value of which something is known before: where it is in a laboratory, and its standard uncertainty."""
    for name, value in lab.values.items():
        # Of a part that nobody stated, not even the size is known.
        std = value.u if value.stated is not None else abs(value.true)
        if std:
            yield (lambda other, name=name: other.values[name]), std
    if lab.added_mass.stated:
        yield (lambda other: other.added_mass), lab.added_mass.u
    for role in ("F1", "V1", "V2"):
        for name, usual in _USUAL.items() if role in lab.sensors else ():
            value = getattr(lab.sensors[role], name)
            if std := value.u or (usual if value.stated is None else 0.0):
                yield (lambda other, role=role, name=name: getattr(other.sensors[role], name)), std


def _dynamic(lab: Laboratory) -> list[Test]:
    return [test for test in lab.tests if test.kind != "static"]


def _owners(lab: Laboratory, tests: list[Test]) -> list[tuple[str, float, float]]:
    """The condition of each entry of the phasors."""
    found = []
    count = 1 if lab.blocked else 2
    for test in tests:
        for _part in range(2):
            for at in range(len(_lines(test))):
                key = (test.specimen, test.preload, test.frequency if test.kind == "sine" else float(at))
                found += [key] * count
    return found


def _remain(unknowns: tuple[Array, Array], move: Array) -> Array:
    """What of a move no unknown explains, with what is known of them before as further entries (N + p,)."""
    columns, weights = unknowns
    both = np.concatenate([columns, np.diag(weights)])
    scale = np.linalg.norm(both, axis=0)
    both = both[:, scale > 0] / scale[scale > 0]
    target = np.concatenate([move, np.zeros(len(weights))])
    left, *_ = np.linalg.svd(both, full_matrices=False)
    return np.asarray(target - left @ (left.T @ target))
