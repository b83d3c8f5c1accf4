"""A campaign becomes result tables: reduction, K1, identification; the only wiring of the pipeline.

Each name is loaded when it is first used: a worker process that reduces recordings needs none of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fourpole.study.analysis import DRAWS, analyse
    from fourpole.study.results import read_results
    from fourpole.study.study import Study

__all__ = ["DRAWS", "Study", "analyse", "read_results"]
_HOME = {"DRAWS": "analysis", "Study": "study", "analyse": "analysis", "read_results": "results"}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"fourpole.study.{_HOME[name]}"), name)
    raise AttributeError(f"module 'fourpole.study' has no attribute {name!r}")
