"""Names of the attributes of a file or a channel that state unit, rate and step of time."""

from __future__ import annotations

UNITS = ("unit", "units", "Unit", "Units")
RATES = ("rate", "sample_rate", "sampling_rate", "samplerate", "fs", "Fs", "sampling_frequency")
STEPS = ("dt", "increment", "step", "sample_interval")
