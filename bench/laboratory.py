"""The laboratory of the benchmarks with many simulated tests, and the check of what is found there."""

from __future__ import annotations

from math import radians

from fourpole.virtual.phasor_rig import Laboratory

__all__ = ["LABORATORY", "check_error"]

LABORATORY = Laboratory(
    moving_mass=(15.0, 0.3),
    preload_stiffness=(12440.0, 250.0),
    preload_damping=(15.0, 5.0),
    std_gain=(0.03,) * 3,
    std_phase=(radians(1.0),) * 3,
    noise=1e-4,
)
#: Largest error of K* in its uncertainty: 200 000 errors of 100 000 tests exceed it with a chance of 4e-4.
_MOST = 6.0


def check_error(tests: int, error: float) -> None:
    """SystemExit if the largest error of K* of some tests, in its uncertainty, is too large."""
    if not error < _MOST:
        raise SystemExit(f"{tests} tests: K* is {error:.1f} of its uncertainties off")
