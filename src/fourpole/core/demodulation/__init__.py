"""From recordings to amplitudes: what is steady, the fit, the noise beside it, and what is undone."""
