"""The core: formulas and estimators in SI units, with numpy and scipy only; it uses no files, plots or clocks."""
