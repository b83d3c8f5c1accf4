"""A campaign becomes result tables: reduction, K1, identification; the only wiring of the pipeline."""

from fourpole.study.results import Results, read_results
from fourpole.study.study import DRAWS, Study, analyse

__all__ = ["DRAWS", "Results", "Study", "analyse", "read_results"]
