"""The commands on single tables, as the command line has them: identify, static and predict."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from fourpole.app.console import frequencies
from fourpole.app.options import JsonFlag, OutFile, RigOptions, TableChoice, amount

StaticStiffness = Annotated[float, amount("--k1", "stiffness", 'Static stiffness, as "180 kN/m".', "positive")]


def identify(
    table: Annotated[Path, typer.Argument(metavar="TABLE", help="Table of any format, with a row per frequency.")],
    k1: Annotated[
        float | None, amount("--k1", "stiffness", 'Static stiffness, as "180 kN/m"; K2 and C need it.', "positive")
    ] = None,
    *,
    above: RigOptions,
    choice: TableChoice,
    file: OutFile = None,
    as_json: JsonFlag = False,
) -> int:
    """K*, K2, C and TR from a table of amplitudes or of K*, or from a frequency response in UFF.

    The table has a frequency and one of (R, I), (F1, V1 or x1, phase), (K', K''), (K', tan delta), (K', C), (|K*|, loss
    angle or tan delta), or the same of a modulus. Amplitudes are both 0 to peak, or both peak to peak; the phase is
    that of the force ahead.
    """
    from fourpole.app.reduced import run_identify

    return run_identify(table, k1, above.rig, choice, file, as_json=as_json)


def static(
    table: Annotated[Path, typer.Argument(metavar="FILE", help="Table of load and deflection, of any format.")],
    load: Annotated[float, amount("--load", "force", 'Load at which K1 is wanted, as "1000 N".')],
    load_column: Annotated[str | None, typer.Option(help="Name of the load's column, if it is not recognised.")] = None,
    deflection_column: Annotated[
        str | None, typer.Option(help="Name of the deflection's column, if it is not recognised.")
    ] = None,
    column: Annotated[
        list[str] | None, typer.Option(metavar="ROLE=NAME", help='Which column is what, as "load=ch7 [kN]".')
    ] = None,
    group: Annotated[str, typer.Option(help="The sheet or group of the file, if several hold a curve.")] = "",
    as_json: JsonFlag = False,
) -> None:
    """Static stiffness K1 at a load from a load-deflection curve, with secant, loss and non-linearity.

    K1 is the tangent of the mean of the loading and unloading branches over the last complete cycle.
    """
    from fourpole.app.reduced import run_static

    named = {"load": load_column, "deflection": deflection_column}
    columns = [*(column or ()), *(f"{role}={name}" for role, name in named.items() if name is not None)]
    run_static(table, load, columns, group, as_json=as_json)


def predict(
    k1: StaticStiffness,
    k2: Annotated[float, amount("--k2", "stiffness", 'Spring of the arm, as "120 kN/m".', "positive")],
    c: Annotated[float, amount("--c", "damping", 'Damper of the arm, as "700 N s/m".', "positive")],
    mass: Annotated[float, amount("--mass", "mass", 'Moving mass, as "15 kg".')],
    preload_stiffness: Annotated[
        float, amount("--preload-stiffness", "stiffness", 'Preload spring K3, as "12.44 kN/m".')
    ],
    frequency: Annotated[str, typer.Option(help='Frequencies, as "10:24:0.5 Hz" or "10,12,14 Hz".')],
    preload_damping: Annotated[
        float | None, amount("--preload-damping", "damping", 'Damper c3 beside it, as "20 N s/m".')
    ] = None,
    file: OutFile = None,
    as_json: JsonFlag = False,
) -> None:
    """K*, R, I and TR that a tyre of known K1, K2 and C has on a rig."""
    from fourpole.app.reduced import run_predict
    from fourpole.core.rig import Rig

    rig = Rig(mass, preload_stiffness, preload_damping or 0.0)
    run_predict((k1, k2, c), rig, frequencies(frequency), file, as_json=as_json)


#: Command functions by the name of the command.
COMMANDS: dict[str, Callable[..., int | None]] = {"identify": identify, "static": static, "predict": predict}
