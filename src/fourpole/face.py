"""What the package offers by name, for rooms below the one that does the work.

A recording is plotted by the room of figures, of which the room of recordings knows nothing: `Recording.plot` asks for
the public function `draw`, which `fourpole.__init__` has the home of. Registries name what rooms above add to them.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any


def public(name: str) -> Any:
    """A name of the package `fourpole`, which is loaded when it is first asked for."""
    return getattr(sys.modules["fourpole"], name)


def load(place: str) -> Any:
    """What a registry names by its place, as "fourpole.models.springs.Spring"."""
    module, _, name = place.rpartition(".")
    return getattr(import_module(module), name)
