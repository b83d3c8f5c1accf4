"""K* of one condition by several amplitudes and added masses: what depends on the amplitude is said, with its size."""

from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from fourpole.campaign.row import Test as Row
from fourpole.core.checks import Code, Verdict
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.phasor import Phasors
from fourpole.study.agreement import agreement, mixed_amplitudes
from fourpole.study.analysis import analyse
from fourpole.words import remark_of

CAMPAIGN = SimpleNamespace(stated=SimpleNamespace(sameness=SimpleNamespace(further=()), all_rigs={}))


def found(stiffness, deflection, *, std=0.005, shared=(), mass=None, frequency=None, fits=True):
    """Checks of one condition, by K* [N/m], the deflection [mm], and u [1] of noise and of errors in common."""
    stiffness, size = np.asarray(stiffness, dtype=complex), np.asarray(deflection) * 1e-3
    count = stiffness.size
    frequency = np.full(count, 12.0) if frequency is None else np.asarray(frequency)
    mass = np.zeros(count) if mass is None else mass
    tests = [Row(f"D{at}", at, tyre="mount", values={"added_mass": float(mass[at])}) for at in range(count)]
    moved = 2 * np.pi * frequency * size
    phasors = Phasors.from_polar(frequency, np.abs(stiffness) * size, 2 * moved, 0.0, moved)
    by = np.stack([np.abs(stiffness) * np.broadcast_to(one, count) for one in shared], axis=-1) if shared else None
    by = np.zeros((count, 2, 0)) if by is None else np.stack([by, 0 * by], axis=1)
    covariance = (std * np.abs(stiffness))[:, None, None] ** 2 * np.eye(2) + by @ by.swapaxes(1, 2)
    result = SimpleNamespace(
        stiffness=stiffness, frequency=frequency, stiffness_shared=by, stiffness_covariance=covariance
    )
    group = SimpleNamespace(
        rig_name="", rows=np.arange(count), phasors=phasors, result=result, estimate=SimpleNamespace(fits=fits)
    )
    points = SimpleNamespace(tests=tests, condition=np.zeros(count, dtype=int), strange=np.zeros(count, dtype=bool))
    return [check for _, check in agreement(CAMPAIGN, points, [group])]


@pytest.mark.parametrize(("percent", "verdict"), [(5.9, Verdict.OK), (6.1, Verdict.WARNING)])
def test_a_change_with_the_amplitude_is_a_warning_from_six_per_cent_on(percent, verdict):
    (check,) = found([1e5, 1e5 * (1 + percent / 100)], [2.0, 0.5])
    assert (check.verdict, check.limit) == (verdict, 0.06)
    assert check.statistic == pytest.approx(percent / 100)


def test_seventeen_per_cent_at_seven_standard_uncertainties_are_said():
    (check,) = found([1e5, 1.17e5], [2.0, 0.5], std=0.0158, mass=[10.0, 0.0])
    assert remark_of(check) == (
        "K* of mount at 12 Hz differs by 17 % (7 standard uncertainties) between deflections of 0.5 and 2 mm, "
        "with 0 and 10 kg added: K* depends on the amplitude: compare it at equal amplitudes only, or make the "
        "amplitude an axis of [conditions]"
    )


@pytest.mark.parametrize(("std", "statistic"), [(0.03, 0.0), (0.01, 0.1)])
def test_what_noise_explains_is_no_difference(std, statistic):
    (check,) = found([1e5, 1.1e5], [2.0, 0.5], std=std)
    assert check.statistic == pytest.approx(statistic)


@pytest.mark.parametrize(("lever", "verdict"), [((0.05, 0.05), Verdict.WARNING), ((0.10, 0.03), Verdict.OK)])
def test_an_error_in_common_cancels_as_far_as_it_is_the_same(lever, verdict):
    """The gains of V1 and V2 act on K* by 1/(1 - V2/V1), which is another one under another mass."""
    (check,) = found([1e5, 1.12e5], [2.0, 0.5], shared=[np.array(lever)], mass=[0.0, 10.0])
    assert check.verdict == verdict


def test_masses_at_one_amplitude_ask_for_another_remedy():
    (check,) = found([1e5, 1.12e5], [2.0, 1.9], mass=[0.0, 10.0])
    assert "with 10 and 0 kg added, at about 2 mm: check the added masses" in remark_of(check)


@pytest.mark.parametrize(
    "case",
    [
        {"deflection": [2.0, 1.9]},
        {"deflection": [2.0, 0.5], "frequency": [12.0, 12.2]},
        {"deflection": [2.0, 0.5], "fits": False},
    ],
    ids=["one level", "other frequencies", "a rig that does not fit"],
)
def test_nothing_is_said_where_nothing_is_compared(case):
    assert found([1e5, 1.3e5], **case) == []


@pytest.mark.sampled(2)
def test_the_chance_of_a_false_alarm_is_that_of_a_search():
    rng, told, runs = np.random.default_rng(7), 0, 400
    for _ in range(runs):
        noise = 0.05 * (rng.normal(size=6) + 1j * rng.normal(size=6))
        (check,) = found(1e5 * np.exp(noise), np.geomspace(0.2, 2.0, 6), std=0.05)
        told += check.verdict is not Verdict.OK
    assert told <= 3 * SEARCH_CHANCE * runs


def test_a_curve_that_mixes_amplitudes_is_noted():
    rows = [np.arange(2), np.arange(2, 4), np.arange(4, 6)]
    points = SimpleNamespace(tests=[Row("D", 1, tyre=name) for name in "aabbcc"], by_condition=lambda known: rows)
    alone = SimpleNamespace(deflection=1e-3 * np.array([1.0, 3.0, 1.0, 2.5, 1.0, 1.9]))
    (note,) = mixed_amplitudes(points, alone, ())
    assert note == (
        "the curve of a mixes deflection amplitudes of 1 to 3 mm (and of 1 more conditions): compare K* of rubber at "
        "equal amplitudes only, or make the amplitude an axis of [conditions]"
    )


# --- a campaign ------------------------------------------------------------------------------------------------------

STATED = """
[unstated]
ordinary = "zero"
[rig]
moving_mass = { value = 15.0, unit = "kg", std = 0.1 }
preload_stiffness = { value = 12.44, unit = "kN/m", std = 0.1 }
[channels]
time = { column = "t", unit = "s" }
force_in = { column = "F1", unit = "N", std_gain = "1 %", std_phase = "0.5 deg" }
motion_in = { column = "V1", unit = "m/s", std_gain = "1 %", std_phase = "0.5 deg" }
motion_out = { column = "V2", unit = "m/s", std_gain = "1 %", std_phase = "0.5 deg" }
[specimens.mount]
"""


def isolator(folder, softening):
    """Sines of an isolator below two masses; the softer it is, the more it deflects."""
    rng, rows = np.random.default_rng(8), ["test,file,kind,specimen,frequency [Hz],K1 [N/m],added_mass [kg]"]
    time = np.arange(3000) / 500.0
    for mass in (0.0, 10.0):
        for hertz in (12.0, 16.0, 20.0):
            omega, stiffness = 2 * np.pi * hertz, 1.2e5 * (1 + 0.15j)
            rig = 12440.0 - omega**2 * (15.0 + mass)
            for _ in range(200):
                beyond = 1e-3 * stiffness / (stiffness + rig)
                law = 1.2e5 * (1 + 0.15j) * (1 + softening / (1 + abs(1e-3 - beyond) / 1e-3))
                stiffness = 0.5 * (stiffness + law)
            phasors = (rig * beyond, 1j * omega * 1e-3, 1j * omega * beyond)
            signals = [np.real(one * np.exp(1j * omega * time)) for one in phasors]
            signals = [one + 1e-3 * one.std() * rng.normal(size=time.size) for one in signals]
            name = f"D{len(rows)}"
            pl.DataFrame(dict(zip(("t", "F1", "V1", "V2"), (time, *signals), strict=True))).write_parquet(
                folder / f"{name}.parquet"
            )
            rows.append(f"{name},{name}.parquet,dynamic,mount,{hertz:g},1e5,{mass:g}")
    (folder / "tests.csv").write_text("\n".join(rows) + "\n")
    (folder / "campaign.toml").write_text(STATED)
    return folder


@pytest.mark.parametrize("softening", [0.0, 0.6])
def test_an_isolator_under_two_masses(tmp_path, softening):
    folder = isolator(tmp_path, softening)
    for route in ("joint", "relative"):
        study = analyse(folder, route=route, monte_carlo=0, cache=folder / "cache")
        rows = study.checks.filter(pl.col("code") == Code.AMPLITUDES.text)
        assert rows["verdict"].to_list() == ["warning" if softening else "ok"], route
        assert any(note.startswith("K* of mount at ") for note in study.notes) is bool(softening), route
