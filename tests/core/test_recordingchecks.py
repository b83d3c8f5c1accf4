"""Every check of a recording, at and above its limits; clipping is found where it is and nowhere else."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.core.checks import Check, Code, Verdict
from fourpole.core.demodulation.demodulate import demodulate
from fourpole.core.phasor import CHANNELS, Phasors
from fourpole.core.recording import Channel
from fourpole.core.recordingchecks import (
    check_clipping,
    check_consistency,
    check_distortion,
    check_excitation,
    check_frequency,
    check_gaps,
    check_halves,
    check_lift_off,
    check_mains,
    check_mean_force,
    check_noise,
    check_resonance,
    check_spoilt,
    clipped_share,
)
from fourpole.core.rig import Rig
from fourpole.words import remark_of, said

NAMES = ("F1", "V1", "V2")


@pytest.fixture(scope="module")
def found(record):
    """A clean demodulation, to be spoilt in one place at a time."""
    return demodulate(record(np.array([60.0, 0.06, 0.08]), 10.3, samples=1000))


def speaks(check, verdict, *words):
    assert check.verdict == verdict
    assert (remark_of(check) == "") == (verdict == "ok")
    assert remark_of(check).endswith(said(check).remedy)
    for word in words:
        assert word in remark_of(check)


@pytest.mark.parametrize(
    ("hertz", "verdict"),
    [(10.0, "ok"), (10.099, "ok"), (9.901, "ok"), (10.101, "warning"), (9.899, "warning"), (10.499, "warning"),
     (10.501, "rejected"), (9.499, "rejected"), (20.0, "rejected")],
)  # fmt: skip
def test_stated_frequency(hertz, verdict):
    check = check_frequency(hertz, 10.0)
    speaks(check, verdict, *([f"{hertz:.5g} Hz", "10 Hz is stated", "tests.csv"] if verdict != "ok" else []))
    assert check.statistic == pytest.approx(abs(hertz - 10) / 10)
    assert check.limit == (0.05 if verdict == "rejected" else 0.01)


def test_no_stated_frequency():
    speaks(check_frequency(10.0, None), "ok")


@pytest.mark.parametrize(
    ("peak", "verdict"), [(0.0, "ok"), (900.0, "ok"), (901.0, "warning"), (1000.0, "warning"), (1001.0, "rejected")]
)
def test_lift_off(peak, verdict):
    check = check_lift_off(peak, 1000.0)
    speaks(check, verdict)
    if verdict == "warning":
        assert "close to lifting off" in remark_of(check)
    if verdict == "rejected":
        assert "the specimen lifts off" in remark_of(check)
        assert "100% of the preload of 1000 N" in remark_of(check)
    assert check_lift_off(peak, None).verdict == "ok"


@pytest.mark.parametrize(("share", "verdict"), [(0.0, "ok"), (0.2, "ok"), (0.201, "warning"), (5.0, "warning")])
def test_distortion_is_that_of_the_contact(found, share, verdict):
    spoilt = replace(found, distortion=np.array([9.0, share, 9.0]))
    speaks(check_distortion(spoilt), verdict, *(["harmonics of the displacement"] if verdict != "ok" else []))


@pytest.mark.parametrize(("ratio", "verdict"), [(0.0, "ok"), (0.3, "ok"), (0.301, "warning")])
def test_noise_of_each_channel(found, ratio, verdict):
    rows = check_noise(replace(found, noise_ratio=np.array([ratio, 0.01, np.nan])), NAMES)
    assert [(row.code, row.channel) for row in rows] == [
        (Code.RESIDUAL, "F1"),
        (Code.RESIDUAL, "V1"),
    ]  # V2 was not measured
    speaks(rows[0], verdict)
    speaks(rows[1], "ok")


@pytest.mark.parametrize(
    ("relative", "verdict"), [(0.0, "ok"), (0.049, "ok"), (0.051, "warning"), (0.199, "warning"), (0.201, "rejected")]
)
def test_excitation_of_each_channel(found, relative, verdict):
    covariance = np.zeros((6, 6))
    covariance[3, 3] = (relative * 0.06) ** 2
    amplitudes = np.array([60.0, 0.06j, np.nan])
    phasors = replace(found.phasors, amplitudes=amplitudes, covariance=covariance)
    rows = check_excitation(replace(found, phasors=phasors), NAMES)
    assert [(row.code, row.channel) for row in rows] == [(Code.EXCITATION, "F1"), (Code.EXCITATION, "V1")]
    speaks(rows[0], "ok")
    speaks(rows[1], verdict, *(["V1 hardly moves at 10.3 Hz"] if verdict != "ok" else []))


def test_a_channel_that_stands_still_is_rejected(found):
    phasors = replace(found.phasors, amplitudes=np.array([60.0, 0.0, 0.08]))
    rows = check_excitation(replace(found, phasors=phasors), NAMES)
    assert [row.verdict for row in rows] == ["ok", "rejected", "ok"]


def test_gaps(found):
    speaks(check_gaps(found), "ok")
    speaks(check_gaps(replace(found, missing=0.0005)), "warning", "0.05 % of the samples are missing")


def test_resonance_of_the_rig():
    """K3 - m w² is 5 % of K3 at a frequency 2.5 % off the resonance, and 1 % at 0.5 %."""
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    for off, verdict in ((0.5, "ok"), (0.03, "ok"), (0.02, "warning"), (0.006, "warning"), (0.004, "rejected")):
        check = check_resonance(rig.resonance * (1 - off), rig, 0.0)
        speaks(check, verdict, *(["rig's own resonance (K3 = 12.44 kN/m"] if verdict != "ok" else []))
        assert check.statistic == pytest.approx(1 / (1 - (1 - off) ** 2), rel=1e-9)
    assert check_resonance(rig.resonance, rig, 0.0).verdict == "rejected"
    # an added mass moves the resonance
    speaks(check_resonance(rig.resonance, rig, 10.0), "ok")
    heavier = Rig(moving_mass=25.0, preload_stiffness=12440.0)
    assert check_resonance(heavier.resonance, rig, 10.0).verdict == "rejected"
    # a damper of the rig opens it, and a rig that is free has none
    damped = Rig(moving_mass=15.0, preload_stiffness=12440.0, preload_damping=50.0)
    speaks(check_resonance(rig.resonance, damped, 0.0), "ok")
    speaks(check_resonance(10.0, Rig(moving_mass=15.0), 0.0), "ok")


def one_test(f1_gain=1.0, input_mass=0.0):
    """Phasors of a rig of 15 kg on 12440 N/m at 10 Hz, force cell wrong by a complex gain."""
    omega = 2 * np.pi * 10.0
    v2 = 0.08 * np.exp(0.4j)
    force = (15j * omega + 12440.0 / (1j * omega)) * v2 + 1j * omega * input_mass * 0.06
    return Phasors.from_polar(10.0, abs(f1_gain * force), 0.06, np.angle(f1_gain * force), 0.08, 0.4)


@pytest.mark.parametrize(
    ("gain", "verdict"),
    [(1.0, "ok"), (1.19, "ok"), (0.81, "ok"), (np.exp(0.2j), "ok"), (1.21, "warning"), (0.79, "warning"),
     (-1.0, "warning"), (1j, "warning"), (np.exp(0.21j), "warning")],
)  # fmt: skip
def test_consistency_of_the_three_sensors(gain, verdict):
    check = check_consistency(one_test(gain), Rig(moving_mass=15.0, preload_stiffness=12440.0), 0.0)
    speaks(check, verdict)
    assert check.statistic == pytest.approx(abs(gain - 1), abs=1e-12)
    if gain == -1.0:
        assert "F1 is 1 times, and 180 degrees off" in remark_of(check).replace("-180", "180")


@pytest.mark.parametrize(
    ("gain", "words"),
    [
        (-1.0, "inverted"),
        (9.6, "g read as m/s²"),
        (0.1, "kgf read as N"),
        (1000.0, "N read as kN"),
        (9.9e-4, "kN read as N"),
    ],
)
def test_consistency_knows_the_usual_mistakes(gain, words):
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    assert words in remark_of(check_consistency(one_test(gain), rig, 0.0))
    assert "look" not in remark_of(check_consistency(one_test(1.7 * gain), rig, 0.0)).partition(": ")[0]


def test_consistency_knows_exchanged_motions():
    phasors, rig = one_test(), Rig(moving_mass=15.0, preload_stiffness=12440.0)
    exchanged = replace(phasors, amplitudes=phasors.amplitudes[[0, 2, 1]])
    assert "V1 and V2 look exchanged" in remark_of(check_consistency(exchanged, rig, 0.0))


@pytest.mark.parametrize(("departure", "limit", "verdict"), [
    (0.05, 0.06, "ok"), (0.07, 0.06, "warning"), (0.19, 0.5, "ok"), (0.21, 0.5, "warning"),
])  # fmt: skip
def test_uncertainties_explain_a_departure_up_to_a_fifth(departure, limit, verdict):
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    assert check_consistency(one_test(1 + departure), rig, 0.0, limit).verdict == verdict


def test_consistency_knows_the_added_and_the_input_mass():
    rig = Rig(moving_mass=5.0, preload_stiffness=12440.0, input_mass=2.0)
    assert check_consistency(one_test(input_mass=2.0), rig, 10.0).statistic == pytest.approx(0.0, abs=1e-12)


def test_consistency_says_nothing_without_all_three():
    phasors = one_test()
    for index, name in enumerate(CHANNELS):
        amplitudes = phasors.amplitudes.copy()
        amplitudes[index] = np.nan
        if name == "motion_in":
            continue  # only the input mass needs V1
        check = check_consistency(
            replace(phasors, amplitudes=amplitudes), Rig(moving_mass=15.0, preload_stiffness=12440.0), 0.0
        )
        speaks(check, "ok")
        assert np.isnan(check.statistic)
    still = phasors.amplitudes.copy()
    still[2] = 0.0
    speaks(check_consistency(replace(phasors, amplitudes=still), Rig(moving_mass=15.0), 0.0), "ok")


# Clipping -------------------------------------------------------------------------------------------------------


def sine(rate, frequency, seconds, phase=0.0):
    return np.sin(2 * np.pi * frequency * np.arange(int(rate * seconds)) / rate + phase)


@settings(max_examples=200)
@given(
    bits=st.sampled_from([12, 16]),
    rate=st.sampled_from([200.0, 256.0, 500.0, 1000.0, 1024.0, 2000.0, 2048.0, 5000.0, 10e3, 20e3])
    | st.floats(200.0, 20e3),
    frequency=st.sampled_from([10.0, 12.5, 16.0, 20.0]) | st.floats(5.0, 30.0),
    size=st.floats(0.05, 0.9995),
    phase=st.floats(0.0, 6.28),
    seconds=st.sampled_from([0.7, 2.0, 4.096]),
)
def test_clean_sines_of_a_converter_are_not_clipped(bits, rate, frequency, size, phase, seconds):
    """Whole and broken ratios of rate and frequency, large and small, near the end of the range but not at it."""
    steps = 2 ** (bits - 1)
    samples = np.round(steps * size * sine(rate, frequency, seconds, phase))
    assert clipped_share(Channel(samples, "velocity")) == 0.0
    assert clipped_share(Channel(samples / steps, "velocity", limits=(-1.001, 1.001))) == 0.0


def test_a_sine_that_was_never_rounded_is_not_clipped():
    for rate in (100.0, 160.0, 1000.0, 20e3):
        assert clipped_share(Channel(sine(rate, 10.0, 4.0), "force")) == 0.0


def test_noise_is_not_clipping():
    rng = np.random.default_rng(0)
    for _ in range(30):
        samples = np.round(2047 * (0.8 * sine(1000.0, 10.3, 2.0) + 0.01 * rng.standard_normal(2000)))
        assert clipped_share(Channel(samples, "force")) == 0.0


@pytest.mark.parametrize("bits", [0, 12, 16])
@pytest.mark.parametrize("level", [0.995, 0.97, 0.9, 0.5])
@pytest.mark.parametrize("sides", ["upper", "lower", "both"])
def test_clipped_sines_are_found(sides, level, bits):
    wave = sine(1000.0, 10.3, 4.0)
    low, high = {"upper": (-2, level), "lower": (-level, 2), "both": (-level, level)}[sides]
    clipped = np.clip(wave, low, high)
    truly = np.mean(wave >= high) + np.mean(wave <= low)
    if bits:
        clipped = np.round(2 ** (bits - 1) * clipped)
    check = check_clipping("V1", Channel(clipped, "velocity"))
    assert check.verdict == "rejected"
    assert check.statistic == pytest.approx(truly, rel=0.05, abs=0.01)  # a step of 12 bits widens the top
    assert f"V1 is clipped: {check.statistic:.1%} of its samples" in remark_of(check)


def test_samples_at_a_stated_range_are_clipped_even_if_few():
    wave = sine(1000.0, 10.3, 4.0)
    at_limit = Channel(np.clip(wave, -0.9999, 0.9999), "velocity", limits=(-0.9999, 0.9999))
    assert check_clipping("V2", at_limit).verdict == "rejected"
    below = Channel(0.99 * wave, "velocity", limits=(-1.0, 1.0))
    assert check_clipping("V2", below) == Check(Code.CLIPPING, Verdict.OK, 0.0, 0.0, "V2")
    one = 0.5 * wave
    one[77] = 1.0
    assert clipped_share(Channel(one, "velocity", limits=(-1.0, 1.0))) == pytest.approx(1 / 4000)


def test_a_stated_range_does_not_hide_a_flat_top_below_it():
    """An amplifier that saturates at half the converter's range."""
    clipped = np.clip(sine(1000.0, 10.3, 4.0), -0.5, 0.5)
    assert clipped_share(Channel(clipped, "velocity", limits=(-1.0, 1.0))) > 0.5


def test_missing_samples_do_not_matter_for_clipping():
    wave = np.clip(sine(1000.0, 10.3, 4.0), -2, 0.9)
    wave[5] = np.nan
    assert clipped_share(Channel(wave, "velocity")) == pytest.approx(0.14, abs=0.02)
    assert clipped_share(Channel(np.full(10, np.nan), "velocity")) == 0.0


@pytest.mark.parametrize("steps", [3, 6, 9])
def test_a_coarse_export_is_not_clipping(steps):
    """V1 of 0.06 m/s written with two decimals: a sine of six steps spends 1/4 of its time on the two outer ones."""
    assert clipped_share(Channel(np.round(steps * sine(1000.0, 10.3, 4.0)) / 100, "velocity")) == 0.0


def test_a_blocked_rig_has_no_resonance():
    speaks(check_resonance(10.0, Rig(blocked=True), 0.0), "ok")


@pytest.mark.parametrize(
    ("hertz", "verdict"), [(50.0, "warning"), (119.95, "warning"), (50.35, "ok"), (61.0, "ok"), (13.0, "ok")]
)
def test_mains(found, hertz, verdict):
    """Ten seconds: LINE_GAP bins of a tenth of a hertz beside a multiple of 50 or 60 Hz."""
    near = replace(found, phasors=replace(found.phasors, frequency=hertz), cycles=10 * hertz)
    check = check_mains(near)
    assert check.verdict == ("warning" if check.statistic < check.limit else "ok") == verdict
    assert check.code is Code.MAINS


@pytest.mark.parametrize(("share", "verdict"), [(0.0, "ok"), (0.031, "warning")])
def test_drop_outs_of_each_channel(found, share, verdict):
    checks = check_spoilt(replace(found, spoilt=np.array([0.0, np.nan, share])), NAMES)
    assert [check.channel for check in checks] == ["F1", "V2"]
    speaks(checks[0], "ok")
    speaks(checks[1], verdict, *(["V2 has drop-outs", "3.1 %"] if share else []))


def drifting(record, channel, change, speed=0.0):
    """A recording in which one channel turns by a complex factor over its length, and the speed by a share."""
    time = (np.arange(4000) - 1999.5) / 1000.0
    recording = record(np.array([60.0, 0.06, 0.08j]), 10.3, samples=4000)
    wave = np.exp(2j * np.pi * 10.3 * (time + 0.5 * speed * time**2 / time[-1]))
    for at, row in enumerate(recording.channels.values()):
        size = [60.0, 0.06, 0.08j][at] * (np.exp(change * time / time[-1]) if at == channel else 1.0)
        row.samples[:] = (size * wave).real + 1e-4 * abs(size) * np.random.default_rng(at).normal(size=4000)
    return check_halves(demodulate(recording), NAMES)


@pytest.mark.parametrize("channel", [0, 1, 2])
@pytest.mark.parametrize(
    ("change", "verdict", "word"),
    [
        (0.02, "ok", ""),
        (0.08, "warning", "gain"),
        (-0.08, "warning", "gain"),
        (0.01j, "ok", ""),
        (0.05j, "warning", "clock"),
    ],
)
def test_a_channel_that_drifts_against_the_others_is_named(record, channel, change, verdict, word):
    """From half to half a ramp from -1 to 1 changes by 1."""
    check = drifting(record, channel, change)
    assert (check.verdict, check.channel) == (verdict, NAMES[channel] if word else "")
    if word:
        assert f"{NAMES[channel]} changes by" in remark_of(check)
        assert word in said(check).remedy
        assert ("specimen" in said(check).remedy) == (channel == 1)


def test_a_clock_is_told_by_its_error(record):
    """0.05 rad from half to half, 2 s apart at 10.3 Hz."""
    ppm = float(re.search(r"clock (\d+) ppm off", remark_of(drifting(record, 2, 0.05j)))[1])
    assert ppm == pytest.approx(0.05 / (2 * np.pi * 10.3 * 2.0) * 1e6, rel=0.01)


def test_a_change_of_speed_is_no_drift(record):
    assert drifting(record, 2, 0.04j, speed=0.002).verdict == "ok"


@pytest.mark.parametrize(
    ("mean", "verdict"),
    [(0.0, "ok"), (300.0, "ok"), (1090.0, "ok"), (-1090.0, "ok"), (1200.0, "warning"), (5000.0, "ok")],
)
def test_the_mean_force_is_the_preload_where_the_channel_has_it(mean, verdict):
    check = check_mean_force(mean, 1000.0)
    speaks(check, verdict, *(["1200 N", "1000 N"] if verdict == "warning" else []))
    speaks(check_mean_force(mean, None), "ok")
