"""The exports, one entry each: name, file, source, and the module with the function `write`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fourpole.errors import CampaignError, ModelError
from fourpole.io.folders import model_in, results_in

if TYPE_CHECKING:
    from fourpole.core.specimen import Specimen
    from fourpole.fitting.modelfile import ModelFile
    from fourpole.models.shape import Shape


class Takes(Enum):
    """Source of an export; the value describes it in messages."""

    RESULTS = "a results folder, as fourpole analyse writes it"
    MODEL = "a model file, as fourpole fit writes it"
    MAP = "a map file, as fourpole map writes it"
    EITHER = "a model file or a map, as fourpole fit and fourpole map write them"
    CAMPAIGN = "a campaign folder, with campaign.toml and tests.csv"


@dataclass(frozen=True)
class ExportKind:
    """A kind of export.

    Attributes
    ----------
    file : str
        Default name of the file or folder.
    module : str
        Name of a module of `fourpole.export`; its `write(source, path)` writes the file and returns notes on what is
        left out. The source is an `ExportTables` of results, or a `ModelFile` of a model or map. With a
        dot, the name of another function of the module: materials.write_springs.
    about : str
        Description of the file for the help.
    takes : Takes
        Source of the export.
    extra : str
        Extra of the Python package that the export needs; empty if it needs none.
    options : tuple of str
        Keys of `OPTIONS`: what the function takes besides, by keyword.
    """

    file: str
    module: str
    about: str
    takes: Takes = Takes.RESULTS
    extra: str = ""
    options: tuple[str, ...] = ()

    @property
    def write(self) -> Callable[..., tuple[str, ...]]:
        """The function that writes the file and returns notes on what is left out."""
        module, _, name = self.module.partition(".")
        writer: Callable[..., tuple[str, ...]] = getattr(import_module(f"fourpole.export.{module}"), name or "write")
        return writer


#: What may be stated for an export, in the order of the arguments of `export_results`: how messages name it, and the
#: options of the command that state it.
OPTIONS = {
    "shape": ("the shape of a specimen", ("--mode", "--height", "--area", "--bonded", "--bulk")),
    "poisson": ("Poisson's ratio", ("--poisson",)),
    "points": ("an operating point", ("--at",)),
    "specimen": ("a specimen of its own", ("--specimen",)),
    "frequency": ("a frequency", ("--frequency",)),
    "radius": ("a radius", ("--radius",)),
    "belt": ("a belt", ("--belt-mass", "--belt-share")),
}


def _material(file: str, module: str, about: str) -> ExportKind:
    """A kind that takes the Prony series of a model file."""
    return ExportKind(file, module, about, Takes.MODEL, options=("shape", "poisson"))


def _vehicle(file: str, module: str, about: str, *options: str) -> ExportKind:
    """A kind for vehicle simulations, which takes a model file or a map."""
    return ExportKind(file, module, about, Takes.EITHER, options=("specimen", *options))


def _system(file: str, module: str, about: str, *options: str) -> ExportKind:
    """A kind for vehicle simulations that has operating points, and the belt of a tyre."""
    return _vehicle(file, module, about, "points", "belt", *options)


KINDS = {
    "xlsx": ExportKind("results.xlsx", "workbook", "workbook with all tables", extra="export"),
    "mat": ExportKind("results.mat", "matlab", "MATLAB file, level 5, a struct per table"),
    "tydex": ExportKind("tydex", "tydex", "folder of TYDEX 1.3 files, one per condition"),
    "uff": ExportKind("results.uff", "uff", "UFF 58: V1/F1 and K* of each condition", extra="formats"),
    "netcdf": ExportKind("results.nc", "netcdf", "NetCDF: the grid of conditions and frequencies", extra="maps"),
    "abaqus": _material("prony.inp", "materials.write_abaqus", "of a model: Abaqus *VISCOELASTIC, TIME=PRONY"),
    "ansys": _material("prony.mac", "materials.write_ansys", "of a model: ANSYS TB,PRONY"),
    "lsdyna": _material("prony.k", "materials.write_lsdyna", "of a model: LS-DYNA *MAT_GENERAL_VISCOELASTIC"),
    "lsdyna-springs": _material("springs.k", "materials.write_springs", "of a model: LS-DYNA discrete springs"),
    "prony": _material("prony.csv", "materials.write_prony", "of a model: CSV of stiffnesses, moduli and intervals"),
    "fmu": _system("specimen.fmu", "fmi", "of a model or a map: FMU of FMI 2.0, with C source"),
    "fmu3": _system("specimen-fmi3.fmu", "fmi.write_fmi3", "of a model or a map: the same of FMI 3.0"),
    "statespace": _system("statespace.json", "systems", "of a model or a map: matrices A, B, C, D as JSON"),
    "modelica": _system("FourpoleModels.mo", "systems.write_modelica", "of a model or a map: Modelica source"),
    "tir": _system("specimen.tir", "tir", "of a model or a map: vertical block of a .tir file", "frequency", "radius"),
    "table": _vehicle("lookup.csv", "lookup", "of a model or a map: CSV of K* over frequency and operating point"),
}
#: Kinds that are no more, and what replaces each.
_REMOVED = {"statespace-mat": "statespace has the same matrices as JSON, which MATLAB reads with jsondecode"}
#: All kinds with their descriptions, for the help.
ABOUT = "; ".join(f"{name}: {kind.about}" for name, kind in KINDS.items())


@dataclass(frozen=True)
class Exported:
    """A file that was exported.

    Attributes
    ----------
    path : Path
        The file; for TYDEX the folder.
    notes : tuple of str
        Notes on content that is left out of the file, each with the reason.
    """

    path: Path
    notes: tuple[str, ...] = ()


def export_results(
    folder: str | Path,
    kind: str,
    file: str | Path | None = None,
    *,
    shape: Shape | None = None,
    poisson: float | None = None,
    points: Sequence[Mapping[str, float]] = (),
    specimen: str | None = None,
    frequency: float | None = None,
    radius: float | None = None,
    belt: Specimen | None = None,
) -> Exported:
    """Write the results of an analysis, or a model, for another tool, in one step.

    Parameters
    ----------
    folder : path
        The source of the kind: a results folder that `fourpole analyse` wrote, or a model file. For a kind that takes
        a model, a results folder stands for its model.json; the folder of a campaign stands for its results.
    kind : str
        A key of `KINDS`.
    file : path, optional
        The file to write, for TYDEX the folder; an existing file is replaced. A name without a suffix gets that of the
        kind. The default is the name of the kind in `folder`, or beside a model file.
    shape : Shape, optional
        Shape of the specimen, for moduli in place of stiffnesses; by default the one that the model file states.
    poisson : float, optional [1]
        Poisson's ratio in place of that of the shape in the model file.
    points : sequence of mappings of str to float, optional
        Operating points, by column: {"pressure [Pa]": 1.85e5}. By default the tested conditions of a file of fits.
    specimen : str, optional
        The one specimen of a model file that is exported.
    frequency : float, optional [Hz]
        Frequency of a format that has one stiffness and one damping.
    radius : float, optional [m]
        Unloaded radius of the tyre.
    belt : Specimen, optional
        The belt between the springs of K*, in place of that in the model file; massless for none.

    Returns
    -------
    Exported

    Raises
    ------
    CampaignError
        If there is no such kind, the kind takes another source or has no use for what is stated, or the folder has no
        results.
    ModelError
        If the model, or the map at an operating point, cannot be exported to the kind.
    FileError
        If a package is missing, or the file cannot be written; the message names the `pip install`.
    TableError
        If the results do not fit into the format.

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
        from fourpole.units import shown

        if kind in _REMOVED:
            raise CampaignError(f"the kind {kind} was removed: {_REMOVED[kind]}")
        near = get_close_matches(kind[:60].lower(), KINDS, n=1)
        hint = f"did you mean {near[0]}? It" if near else "it"
        raise CampaignError(f"no kind of file {shown(kind)}: {hint} is one of {', '.join(KINDS)}")
    chosen, place = KINDS[kind], Path(folder)
    stated = zip(OPTIONS, (shape, poisson, points, specimen, frequency, radius, belt), strict=True)
    more: dict[str, Any] = {name: value for name, value in stated if value is not None and value != ()}
    if unused := [name for name in more if name not in chosen.options]:
        what, options = OPTIONS[unused[0]]
        raise CampaignError(f"{kind} has no use for {what}: leave out {', '.join(options)}")
    place = _source(place, chosen.takes)
    given = _given(place)
    if given is not chosen.takes and not (chosen.takes is Takes.EITHER and given in (Takes.MODEL, Takes.MAP)):
        raise CampaignError(f"{kind} takes {chosen.takes.value}; {place.name} is {given.value}: give it the former")
    path = (place if place.is_dir() else place.parent) / chosen.file if file is None else Path(file)
    path = path if path.suffix or path.is_dir() else path.with_suffix(Path(chosen.file).suffix)
    source, ratio = _read(place, given), more.pop("poisson", None)
    source = source if ratio is None else _with_poisson(source, ratio)
    return Exported(path, (*_misfits(source, specimen), *chosen.write(source, path, **more)))


def _with_poisson(file: ModelFile, poisson: float) -> ModelFile:
    """A model file with this Poisson's ratio in each shape."""
    if all(one.shape is None for one in file.models):
        raise ModelError("--poisson: the model file states no shape: state --mode, --height and --area, too")
    models = [
        one if one.shape is None else one.model_copy(update={"shape": replace(one.shape, poisson=poisson)})
        for one in file.models
    ]
    return file.model_copy(update={"models": models})


def _source(place: Path, takes: Takes) -> Path:
    """The results or the model file that the folder of a campaign or of results stands for."""
    if not (place / "model.json").is_file():
        place = results_in(place)
    if takes is Takes.EITHER and place.is_dir():
        return model_in(place)
    if takes is Takes.MODEL and (place / "model.json").is_file():
        return place / "model.json"
    return place


def _given(path: Path) -> Takes:
    """Kind of source that a path is; a folder without campaign.toml, and a missing path, count as results."""
    if path.is_dir():
        return Takes.CAMPAIGN if (path / "campaign.toml").is_file() else Takes.RESULTS
    if not path.is_file():
        return Takes.RESULTS
    from fourpole.fitting.modelfile import read_model_file

    return Takes.MAP if read_model_file(path).kind == "map" else Takes.MODEL


def _misfits(source: Any, specimen: str | None) -> list[str]:
    """The accuracy of models of a source that are off by more than a limit."""
    from fourpole.fitting.accuracy import WARNED, accuracy_of
    from fourpole.fitting.modelfile import ModelFile

    if not isinstance(source, ModelFile):
        return []
    found = [accuracy_of(one) for one in source.models if one.conditions and specimen in (None, one.tyre)]
    found += [accuracy_of(one) for one in source.maps if specimen in (None, one.tyre)]
    return [one.text for one in found if one.discrepancy >= WARNED]


def _read(path: Path, takes: Takes) -> Any:
    """The source of an export."""
    if takes is Takes.RESULTS:
        from fourpole.export.source import read_source

        return read_source(path)
    from fourpole.fitting.modelfile import read_model_file

    return read_model_file(path)
