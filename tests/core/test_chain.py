"""Links of a measurement chain, held against their differential equations and against scipy's filters."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from fourpole.core.chain import Calibrated, Delay, Geophone, HighPass, LowPass
from fourpole.core.demodulation.corrections import corrections_of, links_of, without_crosstalk
from fourpole.core.recording import Channel, CrossTalk, Recording
from fourpole.errors import RecordingError


@given(order=st.integers(1, 12), corner=st.floats(0.1, 1e3), share=st.floats(0.05, 20.0))
def test_filters_are_butterworths(order, corner, share):
    for link, kind in ((HighPass(corner, order), "highpass"), (LowPass(corner, order), "lowpass")):
        zeros, poles, gain = signal.butter(order, 2 * np.pi * corner, kind, analog=True, output="zpk")
        # scipy's poles are good to round-off; twelve of them multiply, near the corner half of it is cancelled
        _, expected = signal.freqs_zpk(zeros, poles, gain, [2 * np.pi * corner * share])
        assert link.at(corner * share) == pytest.approx(expected[0], rel=1e-11)


def test_the_well_known_lead_of_an_iepe_sensor():
    """0.5 Hz at 10 Hz: atan(0.05) = 2.86 degrees ahead."""
    assert np.degrees(np.angle(HighPass(0.5).at(10.0))) == pytest.approx(np.degrees(np.arctan(0.05)), rel=1e-12)


@given(f0=st.floats(0.5, 20.0), zeta=st.floats(0.1, 2.0), frequency=st.floats(0.1, 200.0))
def test_a_geophone_is_its_equation_of_motion(f0, zeta, frequency):
    """Coil against case: z'' + 2 zeta w0 z' + w0² z = -x''; the coil's voltage is as -z' for x' = 1."""
    w, w0 = 2 * np.pi * frequency, 2 * np.pi * f0
    z = -(1j * w) / (w0**2 - w**2 + 2j * zeta * w0 * w)
    assert Geophone(f0, zeta).at(frequency) == pytest.approx(-1j * w * z, rel=1e-9)
    assert Geophone(f0, zeta).at(1e5) == pytest.approx(1.0, abs=1e-3)


def test_a_calibration_runs_straight_and_knows_its_ends():
    link = Calibrated(np.array([5.0, 10.0]), np.array([0.9, 1.1]), np.array([0.2, 0.0]), np.array([0.01, 0.03]))
    assert link.at(7.5) == pytest.approx(1.0 * np.exp(0.1j), rel=1e-15)
    assert link.at(40.0) == 1.1  # a harmonic
    assert link.std_at(7.5) == pytest.approx((0.02, 0.0), rel=1e-15)
    for outside in (4.9, 10.1):
        with pytest.raises(RecordingError, match="is known from 5 to 10 Hz"):
            link.std_at(outside)


def test_links_multiply_in_any_order_and_are_on_record():
    channel = Channel(np.zeros(9), "velocity", delay=1e-3, chain=(HighPass(0.5), LowPass(300.0, 2)))
    rows = corrections_of(Recording(1.0, {"motion_in": channel}), ["motion_in"], 2 * np.pi * 12.0)
    assert [row.name for row in rows] == ["delay", "high-pass", "low-pass"]
    whole = np.prod([link.at(12.0) for link in links_of(channel)])
    assert np.prod([row.gain * np.exp(1j * row.phase) for row in rows]) == pytest.approx(whole, rel=1e-14)
    assert whole == pytest.approx(Delay(1e-3).at(12.0) * HighPass(0.5).at(12.0) * LowPass(300.0, 2).at(12.0), rel=1e-14)


def test_crosstalk_needs_its_source():
    force = Channel(np.zeros(9), "force", crosstalk=(CrossTalk("motion_out", "velocity", 1.0),))
    recording = Recording(1.0, {"force_in": force, "motion_in": Channel(np.zeros(9), "velocity")})
    with pytest.raises(RecordingError, match="cross-talk of V2 in F1 cannot be taken out without V2"):
        without_crosstalk(recording, ["force_in", "motion_in"], 60.0)


def test_crosstalk_both_ways_is_solved_together():
    """F1 shows V1's acceleration, V1 (an acceleration) shows F1: two equations."""
    omega = 60.0
    force = Channel(np.zeros(9), "force", crosstalk=(CrossTalk("motion_in", "acceleration", 0.3),))
    motion = Channel(np.zeros(9), "acceleration", crosstalk=(CrossTalk("force_in", "force", 1e-3),))
    recording = Recording(1.0, {"force_in": force, "motion_in": motion})
    f1, v1 = 50.0 - 20.0j, 0.06 + 0.01j
    shown_f, shown_a = f1 + 0.3 * 1j * omega * v1, 1j * omega * v1 + 1e-3 * f1
    undo, _ = without_crosstalk(recording, ["force_in", "motion_in"], omega)
    np.testing.assert_allclose(undo @ [shown_f, shown_a / (1j * omega)], [f1, v1], rtol=1e-13)
