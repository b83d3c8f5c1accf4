"""Times as recordings have them: rates in files, run-ups, wandering drives, and more samples than memory likes."""

import numpy as np
import pytest

from fourpole.study import load
from fourpole.virtual.bench import Bench, Zener, state_matrices
from fourpole.virtual.cam import Cam
from fourpole.virtual.dynamic_rig import respond, run

pytestmark = pytest.mark.thorough

TYRE, RIG = Zener(110e3, 90e3, 800.0), Bench(15.0, 12440.0, 15.0)
RATE = 1000.0


def within(row, bench, factor=3.0):
    """K2 and C within some of their uncertainties."""
    for name, truth in (("K2 [N/m]", bench.k2), ("C [N s/m]", bench.c)):
        assert row[name] == pytest.approx(truth, abs=factor * row[f"u({name.split()[0]}) [{name.split('[')[1]}"]), name


def noisy(values, rng, share=2e-4):
    return values + share * np.std(values) * rng.standard_normal(values.size)


# A rate in the file ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("line", ["Sample rate: 1000 Hz", "Abtastrate;1 kHz", "dt = 0.001 s"])
def test_a_rate_above_the_table_is_enough(bench, line):
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(14.0))
    bench.row("D1", bench.record("D1", {"F1": f1, "V1": v1, "V2": v2}), "1000,110000")
    path = bench.path / "recordings" / "D1.csv"
    path.write_text(f"{line}\n{path.read_text()}")
    del bench.channels["time"]
    assert bench.found(route="relative")["K2 [N/m]"] == pytest.approx(bench.k2, rel=1e-8)


@pytest.mark.parametrize("rate", ["1010 Hz", "2 kHz"])
def test_a_stated_column_of_times_wins_over_the_preamble_and_both_are_said(bench, rate):
    bench.dynamic("D1")
    path = bench.path / "recordings" / "D1.csv"
    path.write_text(f"Sample rate: {rate}\n{path.read_text()}")
    row = bench.found(route="relative")
    assert row["verdict"] == "warning"
    assert "samples per second, its times 1000" in row["remarks"]
    assert row["K2 [N/m]"] == pytest.approx(bench.k2, rel=1e-8)


def test_two_rates_are_told_with_both(bench):
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(14.0))
    bench.row("D1", bench.record("D1", {"F1": f1, "V1": v1, "V2": v2}), "1000,110000")
    path = bench.path / "recordings" / "D1.csv"
    path.write_text(f"Sample rate: 1000 Hz\n{path.read_text()}")
    bench.channels["time"] = '{ sample_rate = "2 kHz" }'
    row = bench.found(route="relative")
    assert row["verdict"] == "rejected"
    assert "1000 Hz by the file, at 2000 Hz by campaign.toml" in row["remarks"]


# Run-up and run-down ---------------------------------------------------------------------------------------------


def recorded_start(frequency, *, rest, up, steady, down):
    """A drive that stands, runs up, runs, and runs down; the rig's own motion after each change is there too."""
    step, total = 1e-4, rest + up + steady + down
    time = np.arange(0.0, total, step)
    edges = [0.0, rest, rest + up, rest + up + steady, total]
    speed = np.interp(time, edges, np.array([0.0, 0.0, 1.0, 1.0, 0.0]) * 2 * np.pi * frequency)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step)])
    x1, v1 = 1e-3 * np.sin(angle), 1e-3 * np.cos(angle) * speed
    x2, v2, arm = respond(*state_matrices(TYRE, RIG), x1, v1, step, slice(0, None))[:3]
    every = slice(None, None, 10)
    return {"t": time[every], "F1": (TYRE.k1 * (x1 - x2) + arm)[every], "V1": v1[every], "V2": v2[every]}


@pytest.mark.parametrize(("rest", "up", "down"), [(2.0, 3.0, 2.0), (0.0, 2.0, 0.0), (0.0, 0.0, 1.5), (1.0, 0.01, 0.0)])
def test_run_up_and_run_down_are_cut_and_said(bench, rest, up, down):
    rng = np.random.default_rng(1)
    columns = recorded_start(14.0, rest=rest, up=up, steady=6.0, down=down)
    columns |= {name: noisy(columns[name], rng) for name in ("F1", "V1", "V2")}
    bench.row("D1", bench.record("D1", columns), "1000,110000")
    row = bench.found(route="relative")
    assert row["verdict"] == "ok", row["remarks"]
    assert "lead-in, run-up" in row["remarks"]  # from rest: with no run-up too the rig rings first
    assert ("run-down" in row["remarks"]) == (down > 0)
    within(row, bench)


def test_a_steady_recording_is_not_cut(bench):
    rng = np.random.default_rng(2)
    for i, frequency in enumerate((5.0, 10.0, 14.0, 24.0)):
        f1, v1, v2 = (noisy(wave(bench.time), rng, 0.05) for wave in bench.waves(frequency))
        bench.row(f"D{i}", bench.record(f"D{i}", {"t": bench.time, "F1": f1, "V1": v1, "V2": v2}), "1000,110000")
    assert not any("cut" in remark for remark in bench.analyse(route="relative").dynamic["remarks"])


def test_a_window_is_taken_as_it_is(bench):
    bench.columns = (*bench.columns, "window [s]")
    columns = recorded_start(14.0, rest=2.0, up=3.0, steady=6.0, down=0.0)
    bench.row("D1", bench.record("D1", columns), "1000,110000,6..10.5")
    row = bench.found(route="relative")
    assert "cut" not in row["remarks"]
    assert row["K2 [N/m]"] == pytest.approx(bench.k2, rel=1e-6)


# A drive whose speed wanders -------------------------------------------------------------------------------------


def wandering(frequency, *, wander=0.01, period=7.3, seconds=12.0, ripple=()):
    cam = Cam(frequency, wander=wander, wander_period=period, wander_phase=0.7, ripple=ripple)
    motion = run(cam, TYRE, RIG, duration=seconds, sample_rate=RATE, oversampling=10)
    at = np.round((np.arange(round(seconds * RATE)) / RATE - motion.time[0]) / np.diff(motion.time[:2])[0]).astype(int)
    time = motion.time[at]
    slow = 2 * np.pi / period
    angle = 2 * np.pi * frequency * (time + wander / slow * np.sin(slow * time + 0.7))
    return {"t": time, "F1": motion.force[at], "V1": motion.v1[at], "V2": motion.v2[at]}, angle


REFERENCES = {
    "one pulse per revolution": (
        '{ column = "tacho", unit = "V" }',
        lambda angle: 5.0 * ((angle / (2 * np.pi)) % 1 < 0.5),
    ),
    "twelve pulses": ('{ column = "tacho", unit = "V", pulses = 12 }', lambda angle: 2.5 + 2.4 * np.sin(12 * angle)),
    "encoder": ('{ column = "tacho", unit = "deg" }', lambda angle: np.degrees(angle) % 360),
    "encoder that runs backwards, without jumps": ('{ column = "tacho", unit = "rad" }', lambda angle: -angle),
    "two cycles per revolution": (
        '{ column = "tacho", unit = "deg", cycles = 2 }',
        lambda angle: np.degrees(angle / 2) % 360,
    ),
}


@pytest.mark.parametrize(
    ("frequency", "reference"), [(10.0 if at % 2 else 16.0, reference) for at, reference in enumerate(REFERENCES)]
)
@pytest.mark.sampled(2)
def test_with_a_reference_k2_and_c_are_within_their_intervals(bench, frequency, reference):
    said, shown = REFERENCES[reference]
    rng = np.random.default_rng(3)
    columns, angle = wandering(frequency)
    columns = {name: values if name == "t" else noisy(values, rng) for name, values in columns.items()}
    bench.row("D1", bench.record("D1", {**columns, "tacho": shown(angle)}), "1000,110000")
    bench.channels["reference"] = said
    row = bench.found(route="mobility")
    assert row["verdict"] == "ok", row["remarks"]
    within(row, bench)
    assert row["K2 [N/m]"] == pytest.approx(bench.k2, rel=5e-3)
    assert row["C [N s/m]"] == pytest.approx(bench.c, rel=5e-3)
    # the mean speed: the phase turned over the time, here known to what the ends hold of a revolution
    assert row["frequency [Hz]"] == pytest.approx((angle[-1] - angle[0]) / (2 * np.pi * 11.999), rel=2e-3)


@pytest.mark.parametrize("frequency", [10.0, 16.0])
def test_without_a_reference_a_wander_that_harms_is_found_and_said(bench, frequency):
    rng = np.random.default_rng(4)
    columns, _ = wandering(frequency)
    columns = {name: values if name == "t" else noisy(values, rng) for name, values in columns.items()}
    bench.row("D1", bench.record("D1", columns), "1000,110000")
    row = bench.found(route="mobility")
    assert row["verdict"] == "warning"
    assert "the speed of the drive wanders by up to 1." in row["remarks"]
    within(row, bench)


def test_a_steady_drive_is_not_said_to_wander(bench):
    rng = np.random.default_rng(5)
    for i in range(12):
        f1, v1, v2 = (noisy(wave(bench.time), rng, 10.0 ** (-1 - i % 4)) for wave in bench.waves(8.0 + i))
        bench.row(f"D{i}", bench.record(f"D{i}", {"t": bench.time, "F1": f1, "V1": v1, "V2": v2}), "1000,110000")
    assert not any("wanders" in remark for remark in bench.analyse(route="relative").dynamic["remarks"])


@pytest.mark.parametrize(
    ("column", "said", "told"),
    [
        (lambda angle: 0 * angle + 5.0, '{ column = "tacho", unit = "V" }', "the reference is constant"),
        (lambda angle: 0 * angle + 5.0, '{ column = "tacho", unit = "deg" }', "the reference turns 0 times"),
        (
            lambda angle: np.where(np.arange(angle.size) // 400 == 9, 0.0, np.sin(angle)),
            '{ column = "tacho", unit = "V" }',
            "pulses are uneven",
        ),
        (np.sin, '{ column = "tacho", unit = "V", pulses = 60 }', "1 revolutions at 60 per revolution"),
        (np.sin, '{ column = "taco", unit = "V" }', "taco"),
    ],
)
@pytest.mark.sampled(4)
def test_a_reference_that_is_no_use_is_told(bench, column, said, told):
    columns, angle = wandering(10.0)
    bench.row("D1", bench.record("D1", {**columns, "tacho": column(angle)}), "1000,110000")
    bench.channels["reference"] = said
    row = bench.found(route="mobility")
    if told == "taco":
        assert row["verdict"] == "rejected"  # a column that is not there is a mistake, not a bad tacho
    else:
        assert row["verdict"] == "warning"
        assert "[channels] reference is not used" in row["remarks"]
        within(row, bench)  # along the phase of V1
    assert told in row["remarks"]


@pytest.mark.parametrize(("pulses", "lost"), [(1, 1), (12, 3)])
@pytest.mark.sampled(2)
def test_a_lost_pulse_is_no_slower_drive(bench, pulses, lost):
    columns, angle = wandering(10.0)
    tacho = np.where((pulses * angle / (2 * np.pi)) % 1 < 0.5, 5.0, 0.0)
    for at in np.linspace(0.3, 0.7, lost):
        number = np.floor(pulses * angle / (2 * np.pi))
        tacho[number == number[int(at * angle.size)]] = 0.0
    bench.row("D1", bench.record("D1", {**columns, "tacho": tacho}), "1000,110000")
    bench.channels["reference"] = f'{{ column = "tacho", unit = "V", pulses = {pulses} }}'
    row = bench.found(route="mobility")
    assert "[channels] reference is not used: the reference's pulses are uneven" in row["remarks"]
    within(row, bench)


@pytest.mark.sampled(4)
def test_a_wheel_with_a_tooth_left_out_is_read(bench):
    columns, angle = wandering(10.0)
    place = (12 * angle / (2 * np.pi)) % 12
    tacho = np.where((place % 1 < 0.5) & (place >= 1), 5.0, 0.0)
    bench.row("D1", bench.record("D1", {**columns, "tacho": tacho}), "1000,110000")
    bench.channels["reference"] = '{ column = "tacho", unit = "V", pulses = 11 }'
    row = bench.found(route="mobility")
    assert row["verdict"] == "ok", row["remarks"]
    within(row, bench)


def test_a_reference_of_another_speed_is_told(bench):
    columns, angle = wandering(10.0)
    tacho = np.where((angle / (2 * np.pi)) % 1 < 0.5, 5.0, 0.0)
    bench.row("D1", bench.record("D1", {**columns, "tacho": tacho}), "1000,110000")
    bench.channels["reference"] = '{ column = "tacho", unit = "V", pulses = 2 }'
    row = bench.found(route="mobility")
    assert row["verdict"] == "warning"
    assert "Hz, V1 at" in row["remarks"]


# A line beside the excitation is no wander, and its beat no run-up ---------------------------------------------------


@pytest.mark.parametrize(
    ("frequency", "line", "share", "seconds"),
    [
        (24.3274, 24.1088, 0.3, 16.0),
        (32.39, 32.838, 0.3, 7.0),
        (9.16, 10.29, 0.3, 40.0),
        (12.3, 12.5, 0.2, 24.0),
        (6.8498, 7.1958, 0.05, 4.976),
    ],
)
def test_a_line_beside_the_excitation_is_neither_followed_nor_cut(bench, frequency, line, share, seconds):
    rng = np.random.default_rng(6)
    bench.time = np.arange(int(seconds * 500)) / 500.0
    columns = {"t": bench.time}
    for name, wave in zip(("F1", "V1", "V2"), bench.waves(frequency), strict=True):
        foreign = share * abs(wave.amplitude) * np.cos(2 * np.pi * line * bench.time + rng.uniform(0, 6))
        columns[name] = noisy(wave(bench.time), rng, 0.01) + foreign
    bench.row("D1", bench.record("D1", columns), "1000,110000")
    row = bench.found(route="relative")
    assert "wanders" not in row["remarks"]
    assert "cut" not in row["remarks"]
    within(row, bench, 4.0)


# More samples than are needed ------------------------------------------------------------------------------------


@pytest.mark.parametrize("window", ["", "20..80"])
def test_a_long_recording_is_thinned_and_the_same(bench, monkeypatch, window):
    monkeypatch.setattr(load, "_MOST_SAMPLES", 10_000)
    bench.columns = (*bench.columns, "window [s]")
    bench.time = np.arange(100_000) / 1000.0
    bench.dynamic("D1", f"1000,110000,{window}")
    row = bench.found(route="relative")
    # the filter is flat within 1e-8, and alike for all channels
    assert row["verdict"] == "ok", row["remarks"]
    assert row["K2 [N/m]"] == pytest.approx(bench.k2, rel=1e-7)
    assert row["C [N s/m]"] == pytest.approx(bench.c, rel=1e-7)


def test_clipping_is_seen_in_a_long_recording(bench, monkeypatch):
    monkeypatch.setattr(load, "_MOST_SAMPLES", 10_000)
    bench.time = np.arange(40_000) / 1000.0
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(14.0))
    top = 0.9 * np.abs(f1).max()
    columns = {"t": bench.time, "F1": np.clip(f1, -top, top), "V1": v1, "V2": v2}
    bench.row("D1", bench.record("D1", columns), "1000,110000")
    row = bench.found(route="relative")
    assert row["verdict"] == "rejected"
    assert "F1 is clipped" in row["remarks"]


def test_pieces_and_the_whole_are_the_same(bench, monkeypatch):
    """A table read in stretches, its time column too, against the same read whole."""
    from fourpole.io import stream as recordings

    bench.dynamic("D1")
    whole = bench.analyse(route="relative").dynamic
    monkeypatch.setattr(recordings, "_SMALL", 0)
    monkeypatch.setattr(recordings, "_WHOLE", 0)
    monkeypatch.setattr(recordings, "_ROWS", 700)
    pieces = bench.analyse(route="relative").dynamic
    for name in ("frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]", "K2 [N/m]", "C [N s/m]", "TR measured [1]"):
        np.testing.assert_allclose(pieces[name].to_numpy(), whole[name].to_numpy(), rtol=1e-9)
