"""Kinds: which kinds of file the results are exported to, and the one verb that does it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path

from fourpole.errors import CampaignError
from fourpole.export.source import Source, read_source
from fourpole.units import shown

__all__ = ["KINDS", "Exported", "Kind", "export_results"]

Writer = Callable[[Source, Path], tuple[str, ...]]


@dataclass(frozen=True)
class Kind:
    """A kind of file: its name in the results' folder, and the module whose `write` makes it."""

    file: str
    module: str
    about: str

    @property
    def write(self) -> Writer:
        """What writes it; it gives back what is left out."""
        writer: Writer = import_module(f"fourpole.export.{self.module}").write
        return writer


KINDS = {
    "xlsx": Kind("results.xlsx", "workbook", "workbook with all tables and charts"),
    "mat": Kind("results.mat", "matlab", "MATLAB file, level 5, a struct per table"),
    "tydex": Kind("tydex", "tydex", "folder of TYDEX 1.3 files, one per condition"),
    "uff": Kind("results.uff", "uff", "UFF 58: V1/F1 and K* of each condition"),
    "netcdf": Kind("results.nc", "netcdf", "NetCDF: the grid of conditions and frequencies"),
}


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes
    ----------
    path : Path
        The file; of TYDEX the folder.
    notes : tuple of str
        What is not in it, and why.
    """

    path: Path
    notes: tuple[str, ...] = ()


def export_results(folder: str | Path, kind: str, file: str | Path | None = None) -> Exported:
    """Write the results of an analysis for another tool, in one step.

    Parameters
    ----------
    folder : path
        A results folder, as `fourpole analyse` wrote it.
    kind : {"xlsx", "mat", "tydex", "uff", "netcdf"}
    file : path, optional
        The file, of TYDEX the folder, to write; by default in `folder`: results.xlsx, results.mat, tydex,
        results.uff, results.nc. It is replaced if it exists.

    Returns
    -------
    Exported

    Raises
    ------
    CampaignError
        If there is no such kind, or the folder holds no results.
    FileError
        If a package is missing (the message names the `pip install`), or the file cannot be written.
    TableError
        If the format cannot hold the results.

    Examples
    --------
    >>> import tempfile
    >>> from fourpole import analyse
    >>> from fourpole.virtual import simulate_campaign
    >>> with tempfile.TemporaryDirectory() as place:
    ...     campaign = simulate_campaign(place, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True)
    ...     folder = analyse(campaign.folder).write(campaign.folder / "results")
    ...     export_results(folder, "mat").path.name
    'results.mat'
    """
    if kind not in KINDS:
        near = get_close_matches(kind[:60].lower(), KINDS, n=1)
        hint = f"did you mean {near[0]}? It" if near else "it"
        raise CampaignError(f"no kind of file {shown(kind)}: {hint} is one of {', '.join(KINDS)}")
    chosen = KINDS[kind]
    source = read_source(folder)
    path = Path(folder) / chosen.file if file is None else Path(file)
    return Exported(path, chosen.write(source, path))
