"""The cam: its motion, velocity and acceleration belong together."""

import numpy as np
import pytest

from fourpole.virtual import Cam

WORN = {"profile": ((2, 0.006, 0.7), (3, 0.002, 2.1)), "ripple": ((1, 1.5e-3, 0.3), (2, 1e-3, 1.0)), "wander": 1e-4}


def test_velocity_of_the_cam_is_the_slope_of_its_displacement():
    cam = Cam(13.0, **WORN)
    t, h = np.linspace(0.0, 4.0, 999), 1e-6
    slope = (cam.motion(t + h)[0] - cam.motion(t - h)[0]) / (2.0 * h)
    np.testing.assert_allclose(cam.motion(t)[1], slope, atol=1e-7)


def test_mean_speed_of_the_cam_is_its_frequency():
    cam = Cam(10.0, wander=1e-3, wander_period=4.0)
    (ends, _) = cam.motion(np.array([0.0, 4.0]))
    assert ends[0] == pytest.approx(ends[1], abs=1e-15)


def test_acceleration_of_the_cam_is_the_slope_of_its_velocity():
    cam = Cam(13.0, **{**WORN, "wander": 1e-3})
    t, h = np.linspace(0.0, 4.0, 999), 1e-5
    slope = (cam.motion(t + h)[1] - cam.motion(t - h)[1]) / (2.0 * h)
    # the difference quotient errs by (3 w h)^2/6 of the third harmonic, and by round-off over h
    np.testing.assert_allclose(cam.acceleration(t), slope, atol=1e-6 * abs(slope).max())
