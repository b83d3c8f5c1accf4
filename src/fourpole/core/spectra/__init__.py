"""Averaged cross spectra of a recording under random excitation or a sweep, and the amplitudes that they give."""
