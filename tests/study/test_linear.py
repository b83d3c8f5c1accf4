"""A bench with blocked output and no V2: a friction damper is not linear, a rubber on a poor drive is."""

import numpy as np
import pytest

from fourpole.core.checks import Code
from fourpole.findings.facts import Facts
from fourpole.findings.list import verdicts
from fourpole.study.analysis import analyse

CAMPAIGN = """
[unstated]
ordinary = "zero"
[rig]
output = "blocked"
[channels]
time = { column = "t", unit = "s" }
force_in = { column = "F", unit = "N", exact = true }
motion_in = { column = "x", unit = "mm", exact = true }
[specimens.damper]
"""
FREQUENCIES, AMPLITUDE = (1.0, 4.0), 0.01


def rubber(motion, rate):
    """Force of a Zener body, through its spectrum."""
    jw = 2j * np.pi * np.fft.rfftfreq(motion.size, 1 / rate)
    return np.fft.irfft(3e5 * (1 + 1.2 * 0.02 * jw / (1 + 0.02 * jw)) * np.fft.rfft(motion), motion.size)


def friction(motion, rate):
    """Force of a dry friction of 800 N behind a stiff spring, with a little damping."""
    force, slid = np.empty_like(motion), 0.0
    for i, x in enumerate(motion):
        slid = np.clip(slid, x - 800 / 2e6, x + 800 / 2e6)
        force[i] = 2e6 * (x - slid)
    return force + 100 * np.gradient(motion) * rate


@pytest.fixture
def bench(tmp_path):
    def make(specimen, k1):
        (tmp_path / "recordings").mkdir()
        rng, rows = np.random.default_rng(1), ["test,file,kind,specimen,frequency [Hz],K1 [N/m],u(K1) [N/m]"]
        for at, hertz in enumerate(FREQUENCIES, 1):
            rate = 200 * hertz
            turn = 2 * np.pi * hertz * np.arange(2400) / rate
            motion = AMPLITUDE * (np.sin(turn) + 0.012 * np.sin(2 * turn + 1) + 0.008 * np.sin(3 * turn + 2))
            force = specimen(motion, rate)
            force = force + 0.005 * np.ptp(force) * rng.normal(size=force.size) + 50
            columns = np.c_[turn / (2 * np.pi * hertz), 1e3 * motion + 1e-3 * rng.normal(size=turn.size), force]
            name = f"recordings/D{at}.csv"
            np.savetxt(tmp_path / name, columns, delimiter=",", header="t,x,F", comments="", fmt="%.9g")
            rows.append(f"D{at},{name},dynamic,damper,{hertz:g},{k1:g},1e3")
        (tmp_path / "tests.csv").write_text("\n".join(rows) + "\n")
        (tmp_path / "campaign.toml").write_text(CAMPAIGN)
        return analyse(tmp_path)

    return make


def test_a_friction_damper_is_said_to_be_not_linear_before_anything_else(bench):
    dynamic = bench(friction, 1e3).dynamic
    assert dynamic["verdict"].to_list() == ["warning", "warning"]
    assert all(remark.startswith("the specimen is not linear") for remark in dynamic["remarks"])
    np.testing.assert_allclose(dynamic["deflection amplitude [m]"], AMPLITUDE, rtol=1e-3)


@pytest.mark.parametrize("bent", [False, True])
def test_random_excitation_tells_distortion_from_noise(tmp_path, bent):
    """A magneto-rheological damper, and a linear one with a poor force cell."""
    rng, rate, size = np.random.default_rng(3), 250.0, 10_000
    frequency = np.fft.rfftfreq(2 * size, 1 / rate)
    spectrum = rng.normal(size=(2, frequency.size)) * (frequency > 0.8) * (frequency < 40) / (1 + frequency / 4) ** 2
    motion = np.fft.irfft(spectrum[0] + 1j * spectrum[1])[:size]
    motion *= 3e-3 / motion.std()
    velocity = np.gradient(motion) * rate
    force = 2e4 * motion + 800 * velocity
    if bent:
        force += 300 * np.tanh((velocity + 3 * motion) / (0.15 * velocity.std()))
    force += (0.1 if bent else 1.0) * force.std() * rng.normal(size=size)
    columns = np.c_[np.arange(size) / rate, 1e3 * motion, force]
    np.savetxt(tmp_path / "r.csv", columns, delimiter=",", header="t,x,F", comments="", fmt="%.9g")
    heads = "test,file,kind,specimen,frequency [Hz],K1 [N/m],u(K1) [N/m]"
    (tmp_path / "tests.csv").write_text(f"{heads}\nR1,r.csv,random,damper,2:30,1e3,1e2\n")
    (tmp_path / "campaign.toml").write_text(CAMPAIGN)
    table = analyse(tmp_path, monte_carlo=0).dynamic
    said = "the specimen is not linear: distortion of at least -1"
    assert all(remark.startswith(said) is bent for remark in table["remarks"])
    assert any("record longer" in remark for remark in table["remarks"]) is not bent


def test_what_is_not_linear_stands_before_a_rejection(bench):
    """A mass in the fixture makes K' negative, so that a test is rejected; the report says first why."""

    def heavy(motion, rate):
        return friction(motion, rate) + 400 * np.gradient(np.gradient(motion)) * rate**2

    study = bench(heavy, 1e3)
    assert "rejected" in set(study.dynamic["verdict K2 C"])
    assert all(remark.startswith("the specimen is not linear") for remark in study.dynamic["remarks"])
    _, first, *_ = verdicts(Facts(study))
    assert first.detail.code is Code.LINEARITY


def test_a_rubber_is_linear(bench):
    dynamic = bench(rubber, 2.5e5).dynamic
    assert dynamic["verdict"].to_list() == ["ok", "ok"]
    assert dynamic["remarks"].to_list() == ["", ""]
