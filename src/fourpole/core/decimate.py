"""Decimation: a channel at a lower sampling rate, chunk by chunk, with unchanged amplitudes and times."""

from __future__ import annotations

import numpy as np
import scipy

from fourpole.core.arrays import FloatArray

#: Attenuation of components that alias onto the band, and flatness of the band [dB].
_ATTENUATION = 160.0
#: Ends of the pass band and start of the stop band, as shares of the new rate.
_PASS, _STOP = 0.45, 0.55


class Decimator:
    r"""Every n-th sample of a channel after a linear-phase low-pass, from successive chunks.

    The filter is flat within 1e-8 up to 0.45 of the new rate, and attenuates components that alias onto that band by a
    factor of 1e-8. Its delay is exact, and `shift` includes it.

    Parameters
    ----------
    factor : int
        n >= 1; 1 keeps all samples.

    Examples
    --------
    >>> thin = Decimator(4)
    >>> for piece in np.split(np.cos(0.01 * np.arange(4000)), 4):
    ...     thin.feed(piece)
    >>> samples = thin.samples()
    >>> bool(np.allclose(samples, np.cos(0.01 * (thin.shift + 4 * np.arange(samples.size))), atol=1e-7))
    True
    """

    def __init__(self, factor: int) -> None:
        self.factor = factor
        self._taps = _taps(factor) if factor > 1 else np.ones(1)
        self._held = np.empty(0)
        self._skip = 0
        self._parts: list[FloatArray] = []

    @property
    def shift(self) -> float:
        """Position of the first output sample, in input samples."""
        return 0.5 * (self._taps.size - 1)

    def feed(self, piece: FloatArray) -> None:
        """Add samples; a missing one (not-a-number) makes all output samples missing that depend on it."""
        if self.factor == 1:
            self._parts.append(np.asarray(piece, dtype=float))
            return
        run = np.concatenate([self._held, piece])
        outputs = run.size - self._taps.size + 1
        if outputs <= 0:
            self._held = run
            return
        known = np.isfinite(run)
        smooth = scipy.signal.oaconvolve(np.where(known, run, 0.0), self._taps, mode="valid")
        if not known.all():
            gaps = np.concatenate([[0], np.cumsum(~known)])
            smooth[gaps[self._taps.size :] > gaps[: -self._taps.size]] = np.nan
        self._parts.append(smooth[self._skip :: self.factor].copy())  # a view would keep the whole array in memory
        self._skip = (self._skip - outputs) % self.factor
        self._held = run[outputs:].copy()

    def samples(self) -> FloatArray:
        """All output samples so far."""
        return self._parts[0] if len(self._parts) == 1 else np.concatenate([np.empty(0), *self._parts])


def _taps(factor: int) -> FloatArray:
    """Coefficients of the low-pass for a factor."""
    count, beta = scipy.signal.kaiserord(_ATTENUATION, 2 * (_STOP - _PASS) / factor)
    return np.asarray(scipy.signal.firwin(count | 1, (_PASS + _STOP) / factor, window=("kaiser", beta)))
