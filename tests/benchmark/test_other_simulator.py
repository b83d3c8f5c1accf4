"""Recordings without noise against another simulator: one matrix of dynamic stiffness by nodes, and sensors by formula.

It takes nothing of the generator but the parameters that a campaign leaves beside its truth.
"""

import json

import numpy as np
import polars as pl
import pytest

from elastomer_truth import __main__ as command

pytestmark = pytest.mark.thorough

POWERS = {"force": 0, "displacement": 0, "velocity": 1, "acceleration": 2}


def springs(one, preload, stiffer, lossier, f):
    """K* of a specimen at a frequency [N/m]: static tangent, relaxing arms, and fluid in a channel."""
    k, s = np.sqrt(one["stiffness"] ** 2 + 4 * one["bend"] * preload) * stiffer, 2j * np.pi * f
    whole = k + sum(share * k * lossier * s * time / (1 + s * time) for share, time in one["arms"])
    if one["track"]:
        share, own, ratio = one["track"]
        turn = s / (2 * np.pi * own)
        whole += share * k * (turn**2 + 2 * ratio * turn) / (1 + turn**2 + 2 * ratio * turn)
    return whole


def ends(lab, test, f):
    """Motion of the contact, F1, motion behind the specimen, and the force there, for a motion of 1 m."""
    value = {name: value["true"] for name, value in lab["values"].items()}.get
    one, s = lab["specimens"][test["specimen"]], 2j * np.pi * f
    k, share = springs(one, test["true"].get("preload", test["preload"]), *test["factors"], f), one["share"]
    weights = {"belt": [1 + share, 1 + 1 / share], "two masses": [3, 3, 3]}.get(one["kind"], [1])
    far, frame, ground = len(weights), len(weights) + 1, len(weights) + 2
    matrix, held = np.zeros((ground + 1, ground + 1), complex), lab["rig"].startswith("blocked")

    def link(first, second, stiffness):
        matrix[np.ix_([first, second], [first, second])] += stiffness * np.array([[1, -1], [-1, 1]])

    for at, weight in enumerate(weights):
        link(at, at + 1, weight * k)
    masses = [value("input mass", 0.0), *[one["mass"]["true"] / max(far - 1, 1)] * (far - 1)]
    below = frame if value("frame stiffness") and not held else ground
    if held:
        masses += [value("frame mass", 0.0), 0.0]
        link(far, ground, value("frame stiffness", 1e25) + s * value("frame damping", 0.0))
    else:
        added = test["added_mass"] * lab["added_mass"]["true"] / (lab["added_mass"]["stated"] or 1.0)
        masses += [value("moving mass") + added + test["true"].get("mass left on", 0.0), value("frame mass", 0.0)]
        link(far, below, value("preload spring") + s * value("preload damping"))
        link(far, ground, value("cable stiffness", 0.0) + s * value("cable damping", 0.0))
    if below == frame:
        link(frame, ground, value("frame stiffness") + s * value("frame damping"))
    matrix[range(frame + 1), range(frame + 1)] += s**2 * np.array(masses)
    free = list(range(1, frame + (below == frame)))
    driven = np.array([1.0, value("base motion", 0.0)])
    x = np.zeros(ground + 1, complex)
    x[[0, ground]] = driven
    x[free] = np.linalg.solve(matrix[np.ix_(free, free)], -matrix[np.ix_(free, [0, ground])] @ driven)
    return x[0], matrix[0] @ x, x[far], weights[-1] * k * (x[far - 1] - x[far])


def as_recorded(lab, test, f):
    """Amplitudes of all channels, with the linear faults of sensors."""
    x1, force, x2, behind = ends(lab, test, f)
    force = behind if lab["rig"].endswith("ground") else force
    found = {}
    for role, motion in {"V1": x1, "F1": force, "V2": x2}.items():
        if role in lab["sensors"]:
            sensor = lab["sensors"][role]
            flaws = sensor["flaws"] | test["flaws"].get(role, {})
            true = motion + flaws.get("fixture", 0.0) * force + flaws.get("crosstalk", 0.0) * x1
            late = sensor["delay"]["true"] + lab["skew"].get(role, 0.0) + flaws.get("jitter", 0.0)
            gain = sensor["gain"]["true"] * flaws.get("factor", 1.0) * (1 + flaws.get("drift", 0.0) * test["place"])
            turned = (2j * np.pi * f) ** POWERS[sensor["quantity"]]
            turned *= np.exp(1j * (sensor["phase"]["true"] - 2 * np.pi * f * late))
            at = 1j * f / (sensor["low_pass"] or np.inf)
            filters = f / (f - 1j * sensor["low_cut"]["true"]) / (1 + np.sqrt(2) * at + at * at)
            found[role] = true * gain * turned * filters * (1 + sensor["slope"]["true"] * (f / 100) ** 2)
    return found


@pytest.mark.parametrize("name", ["H016", "H067", "O001", "O016", "F005", "F018", "F032", "F056"])
@pytest.mark.sampled(3)
def test_phasors_are_those_of_another_simulator(name, tmp_path):
    assert command.main(["make", name, "--work", str(tmp_path), "--clean"]) == 0
    lab = json.loads((tmp_path / "truth" / name / "laboratory.json").read_text())
    tests = [test for test in lab["tests"] if test["kind"] in ("sine", "multisine")]
    files = dict(pl.read_csv(tmp_path / "data" / name / "tests.csv").select("test", "file").iter_rows())
    for test in tests[:: max(1, len(tests) // 4)]:
        path = tmp_path / "data" / name / files[test["name"]]
        table = pl.read_csv(path) if path.suffix == ".csv" else pl.read_parquet(path)
        frequencies = np.array([test["frequency"]])
        if test["kind"] == "multisine":
            frequencies = np.arange(np.ceil(test["band"][0]), np.floor(test["band"][1]) + 1, 5.0)
        found = {}
        for role in ("V1", "F1", "V2"):
            if role in lab["sensors"]:
                values = table[lab["sensors"][role]["column"]].to_numpy().astype(float) / lab["sensors"][role]["scale"]
                length = values.size if test["kind"] == "sine" else lab["rate"]
                turn = 2 * np.pi * np.outer(np.arange(length) / lab["rate"], frequencies)
                parts = np.linalg.lstsq(np.hstack([np.cos(turn), -np.sin(turn)]), values[:length], rcond=None)[0]
                found[role] = parts[: frequencies.size] + 1j * parts[frequencies.size :]
        for at, f in enumerate(frequencies):
            expected = as_recorded(lab, test, f)
            for role in expected:
                assert found[role][at] / found["V1"][at] == pytest.approx(expected[role] / expected["V1"], rel=1e-5)
