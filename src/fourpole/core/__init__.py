"""The core: numpy and scipy only, SI in and SI out; no files, plots, printing or clocks."""
