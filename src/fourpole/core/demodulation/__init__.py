"""Demodulation, from recordings to amplitudes: steady part, fit of sines, noise spectrum, and corrections."""
