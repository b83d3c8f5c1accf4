"""The mean of sensors on one part, and the departures from it."""

import numpy as np
import pytest

from fourpole.core.checks import Verdict
from fourpole.core.recordingchecks import check_tilt
from fourpole.errors import TableError
from fourpole.io.signals import Signal
from fourpole.study.response import MeanOfSensors

TIME = np.arange(4000) / 1000.0
WAVE = np.sin(2 * np.pi * 20.0 * TIME)


def signal(samples, name="acc", unit="m/s2", rate=1000.0):
    return Signal(name, unit, samples, rate=rate)


def fed(*samples, chunks=1):
    mean = MeanOfSensors(len(samples))
    parts = [np.array_split(one, chunks) for one in samples]
    found = [mean.feed([signal(one) for one in chunk]).samples for chunk in zip(*parts, strict=True)]
    return np.concatenate(found), mean.tilt


@pytest.mark.parametrize("chunks", [1, 7])
def test_the_tilt_is_that_of_the_motion_and_not_of_offsets_or_noise(chunks):
    rng = np.random.default_rng(3)
    noise = 0.3 * rng.standard_normal((2, TIME.size))
    mean, tilt = fed(1.08 * WAVE + 5.0 + noise[0], 0.92 * WAVE - 3.0 + noise[1], chunks=chunks)
    assert tilt == pytest.approx(0.08, abs=0.02)
    assert mean == pytest.approx(WAVE + 1.0 + noise.mean(axis=0))


def test_three_sensors_and_missing_samples():
    gap = WAVE.copy()
    gap[100:110] = np.nan
    mean, tilt = fed(1.3 * WAVE, gap, 0.7 * WAVE)
    assert tilt == pytest.approx(0.3)
    assert np.isnan(mean).sum() == 10
    assert fed(np.zeros(50), np.zeros(50))[1] == 0.0


@pytest.mark.parametrize("other", [{"unit": "g"}, {"rate": 500.0}, {"samples": WAVE[:-1]}])
def test_sensors_of_another_unit_or_other_times_are_refused(other):
    with pytest.raises(TableError, match="'right' has another unit, or other times, than 'left' beside it"):
        MeanOfSensors(2).feed([signal(WAVE, "left"), signal(**{"samples": WAVE, "name": "right", **other})])


@pytest.mark.parametrize(
    ("tilt", "verdict"),
    [(0.099, Verdict.OK), (0.101, Verdict.WARNING), (0.99, Verdict.WARNING), (1.01, Verdict.REJECTED)],
)
def test_where_a_tilt_is_told(tilt, verdict):
    assert check_tilt("V2", tilt).verdict is verdict
