"""Options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fourpole.app.console import option

if TYPE_CHECKING:
    from fourpole.core.rig import Rig

__all__ = ["JsonFlag", "OutFile", "rig_of_options"]

JsonFlag = Annotated[bool, typer.Option("--json", help="Print one JSON document, in SI units, for programs.")]
OutFile = Annotated[Path | None, typer.Option("--out", help="Write the table to this CSV file instead of printing it.")]


def rig_of_options(mass: str | None, stiffness: str | None, damping: str | None, *, no_rig: bool) -> Rig | None:
    """The rig of the options; None where there is none."""
    from fourpole.core.rig import Rig
    from fourpole.errors import RigError

    given = mass is not None or stiffness is not None or damping is not None
    if no_rig and given:
        raise RigError("--no-rig and the rig's values contradict each other: keep one of them")
    if not given:
        return None
    if mass is None or stiffness is None:
        raise RigError("the rig needs both --mass and --preload-stiffness")
    return Rig(
        moving_mass=option(mass, "mass", "--mass"),
        preload_stiffness=option(stiffness, "stiffness", "--preload-stiffness"),
        preload_damping=0.0 if damping is None else option(damping, "damping", "--preload-damping"),
    )
