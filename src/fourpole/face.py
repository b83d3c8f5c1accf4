"""What the package offers by name, for methods of classes in rooms below the one that does the work.

A recording is plotted by the room of figures, of which the room of recordings knows nothing: `Recording.plot` asks for
the public function `draw`, which `fourpole.__init__` has the home of.
"""

from __future__ import annotations

import sys
from typing import Any


def public(name: str) -> Any:
    """A name of the package `fourpole`, which is loaded when it is first asked for."""
    return getattr(sys.modules["fourpole"], name)
