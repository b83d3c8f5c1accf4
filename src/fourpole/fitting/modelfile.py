"""Model files: models and operating maps as one versioned JSON document, described in docs/model-file.md."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationError

from fourpole.core.condition import Axis, axis_of
from fourpole.errors import ModelError, TableError
from fourpole.fitting.document import MOST_BYTES, changes, check_seal, document_of, listed
from fourpole.fitting.inertia import InertiaFile
from fourpole.fitting.modelparts import (
    LARGEST,
    LONGEST,
    AxisFile,
    Grown,
    NamedValue,
    OffsetFile,
    Provenance,
    PutBackFile,
    Share,
    Strict,
    SurfaceFile,
    ToleranceFile,
    VerdictFile,
    check_covariance,
    check_offsets,
    finite_or_none,
    split_column,
)  # fmt: skip
from fourpole.fitting.ranges import RangeFile
from fourpole.fitting.stated import RigFile
from fourpole.fitting.static import StaticFile
from fourpole.fitting.temperature import TemperatureFile, check_temperature
from fourpole.io.published import read_listed, write_result
from fourpole.io.seal import KEY, sealed
from fourpole.models.families import model_named
from fourpole.models.interface import Link, Model
from fourpole.models.linearised import Scatter
from fourpole.models.operating import Offsets, OperatingMap
from fourpole.models.shape import Shape
from fourpole.models.surface import Axes
from fourpole.models.together import LeaveOneOut
from fourpole.units import shown

#: Largest number of parameters of a model: those of a Prony series with 300 arms.
_MOST_PARAMETERS = 601
#: Frequencies from low to high [Hz].
Band = tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]]
#: Amplitudes of the deflection, rising [m].
Amplitudes = Annotated[
    list[Annotated[float, Field(gt=0)]] | None,
    Field(max_length=1000, description="Tested 0-to-peak deflections [m], rising, if K* of the model depends on them."),
]


class ParameterFile(Strict):
    """A parameter of the model; the unit is part of the contract."""

    symbol: str
    unit: str
    meaning: str = ""
    low: float | None = Field(description="Least value; null: none.")
    high: float | None = Field(description="Greatest value; null: none.")


class CandidateFile(Strict):
    """A model that was tried, on all conditions of the tyre."""

    model: str
    causal: bool
    free: int
    chi2: float
    dof: int
    aicc: float
    bic: float
    cross_validation: float | None = Field(
        description="Cross-validation error over frequencies, in standard uncertainties [1]; null: not computed."
    )
    on_bound: int
    not_converged: int = Field(description="Number of conditions whose fit did not converge.")


class ConditionFile(Grown):
    """One tested condition, with the parameters fitted to it."""

    later: ClassVar = ("points", "amplitude", "static", "inertia", "ranges", "rest")
    state: list[NamedValue] = Field(max_length=20)
    tests: list[str] = Field(max_length=LONGEST)
    points: list[int] = Field(
        default_factory=list, max_length=LONGEST, description="Point of each of `tests`; without it, 1."
    )
    band: Band = Field(description="Lowest and highest frequency fitted [Hz].")
    amplitude: Amplitudes = None
    values: list[float] = Field(max_length=_MOST_PARAMETERS, description="Values of the parameters, in their order.")
    covariance: list[list[float]] = Field(max_length=_MOST_PARAMETERS, description="Covariance of the parameters.")
    intervals: list[tuple[float | None, float | None]] = Field(
        max_length=_MOST_PARAMETERS, description="95 % profile-likelihood intervals; null where the data set no end."
    )
    on_bound: list[str] = Field(max_length=_MOST_PARAMETERS, description="Symbols of parameters on a bound.")
    chi2: float
    dof: int
    converged: bool
    agreed: float = Field(description="Fraction of the starts that led to this optimum [1].")
    verdict: VerdictFile | None = Field(description="null where the uncertainty of K* is not known.")
    static: StaticFile | None = Field(default=None, description="Static test that was joined as a ramp.")
    inertia: InertiaFile | None = Field(default=None, description="Mass of the specimen between its ends.")
    ranges: list[RangeFile] = Field(
        default=[], max_length=200, description="Range of K* below and above the band, rising."
    )
    rest: tuple[float, float] | None = Field(default=None, description="Range of K1 [N/m] where it was not measured.")

    @property
    def coordinates(self) -> dict[str, float]:
        """Values on the axes, by column."""
        return {one.column: one.value for one in self.state}


class _Entry(Grown):
    """Base of the entries of one tyre: its model."""

    tyre: str
    model: str = Field(max_length=40)
    causal: bool
    parameters: list[ParameterFile] = Field(max_length=_MOST_PARAMETERS)
    put_back: PutBackFile | None = Field(default=None, description="The data against what a query answers for them.")


class ModelEntry(_Entry):
    """A model of one tyre, with a set of parameters for each tested condition."""

    later: ClassVar = ("put_back", "shape", "temperature")
    discrepancy: Share = Field(
        description="Model discrepancy: relative error of K* that makes chi-square equal its degrees of freedom [1]."
    )
    shape: Shape | None = Field(default=None, description="Height, area and load of the specimen, where stated.")
    choice: str = Field(description="The choice of the model in words.")
    candidates: list[CandidateFile] = Field(max_length=200, description="Models that were compared, the best first.")
    conditions: list[ConditionFile] = Field(max_length=LONGEST)
    temperature: TemperatureFile | None = Field(
        default=None, description="Shift factors and their law if the model is of a master curve."
    )
    pressures: list[Any] = Field(
        default_factory=list, max_length=1000, exclude=True,
        description="Of earlier versions: what a shell's fits to several pressures shared.",
    )  # fmt: skip


class MapEntry(_Entry):
    """An operating map of one tyre: each linked parameter is a polynomial of the scaled axes."""

    later: ClassVar = ("put_back", "amplitude", "inertia", "offsets")
    link: Link = Field(default="log", description="Whether stiffness and damping or their logarithms are polynomials.")

    axes: list[AxisFile] = Field(max_length=10)
    constant: list[NamedValue] = Field(max_length=20, description="Axes with one value in all conditions.")
    terms: list[list[int]] = Field(max_length=500, description="Exponents of the axes, term by term.")
    coefficients: list[list[float]] = Field(
        max_length=_MOST_PARAMETERS, description="One list per parameter, one number per term."
    )
    covariance: list[list[float]] = Field(max_length=2000, description="Covariance of all coefficients in turn.")
    scatter: list[Share] = Field(
        min_length=3, max_length=4,
        description="Relative scatter: of conditions along K*; of frequencies, along and across K*; of conditions "
        "across K*, without which it is that along.",
    )  # fmt: skip
    band: Band = Field(description="[Hz]")
    amplitude: Amplitudes = None
    leave_one_out: tuple[float | None, float | None, float | None] = Field(
        description="Relative leave-one-out error; fraction of K', K'' and of conditions inside 95 %; null: none."
    )
    static: SurfaceFile | None = Field(description="null: K1 is the model's stiffness at zero frequency.")
    choice: str
    inertia: InertiaFile | None = Field(default=None, description="Mean of the conditions.")
    offsets: list[OffsetFile] = Field(
        default_factory=list, max_length=LONGEST, description="Errors of the tested conditions about the surfaces."
    )


class ModelFile(Grown):
    """The whole document."""

    later: ClassVar = ("axes",)
    format: Literal["fourpole-model"] = "fourpole-model"
    version: Literal[1] = 1
    kind: Literal["model", "map"]
    models: list[ModelEntry] = Field(default_factory=list, max_length=1000)
    maps: list[MapEntry] = Field(default_factory=list, max_length=1000)
    axes: list[ToleranceFile] = Field(
        default_factory=list, max_length=20, description="Axes besides pressure, preload and temperature."
    )
    rig: RigFile | None = None
    provenance: Provenance

    @property
    def tyres(self) -> list[str]:
        """Names of the tyres that have a model or a map."""
        return [one.tyre for one in self.models] + [one.tyre for one in self.maps]

    def model_entry(self, tyre: str) -> ModelEntry | None:
        """The fits of a tyre."""
        return next((one for one in self.models if one.tyre == tyre), None)

    def map_entry(self, tyre: str) -> MapEntry | None:
        """The map of a tyre."""
        return next((one for one in self.maps if one.tyre == tyre), None)

    def condition_at(self, tyre: str, coordinates: Mapping[str, float]) -> ConditionFile | None:
        """The condition of a tyre's fits with exactly these values on the axes."""
        entry = self.model_entry(tyre)
        conditions = () if entry is None else entry.conditions
        return next((one for one in conditions if one.coordinates == coordinates), None)

    def axis(self, column: str) -> Axis:
        """The axis of a column, with its tolerance."""
        own = (Axis(one.column, "", one.relative, one.absolute) for one in self.axes if one.column == column)
        return next(own, axis_of(column))

    @property
    def document(self) -> dict[str, Any]:
        """The sealed document, in types of JSON."""
        return sealed(self._content())

    def _content(self) -> dict[str, Any]:
        """The document without its seal."""
        return self.model_dump(mode="json", by_alias=True)

    def write(self, path: str | Path) -> None:
        """Write the document in one step, sealed, with the time."""
        now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        write_result(path, (json.dumps(sealed(self._content(), now), indent=1, ensure_ascii=False) + "\n").encode())


class SealFile(Strict):
    """The seal of the document; docs/model-file.md has the canonical form and a program that checks it."""

    method: Literal["SHA-256 of the canonical form of RFC 8785"]
    written: str = Field(default="", description="Time of writing in UTC, as 2026-01-31T12:00:00Z.")
    parts: dict[str, Any] = Field(description="Marks of the parts, in the shape of the document.")
    whole: str = Field(description="SHA-256 of the document with this seal, without this value.")


class _SealedFile(ModelFile):
    """The document as it is in a file."""

    seal: SealFile


def schema() -> dict[str, Any]:
    """The JSON schema of a model file."""
    found = {**_SealedFile.model_json_schema(), "title": "ModelFile", "description": ModelFile.__doc__}
    found["$defs"]["Shape"]["description"] = (Shape.__doc__ or "").partition("\n")[0]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found}


def read_model_file(path: str | Path) -> ModelFile:
    """Read and check a model file.

    Raises
    ------
    FileError
        If the file cannot be read.
    ModelError
        If it is no model file, has a later version, contradicts itself, is not sealed, or was changed since.
    """
    try:
        return model_file_of(read_listed(path, max_bytes=MOST_BYTES), Path(path).name)
    except TableError as error:
        raise ModelError(str(error)) from None


def model_file_of(content: bytes, name: str) -> ModelFile:
    """The checked content of a model file from its bytes; see `read_model_file`."""
    document = document_of(content, name)
    made = checked(name, document)
    check_seal(name, document)
    return made


def checked(name: str, document: dict[str, Any]) -> ModelFile:
    """The content of a document, whatever its seal; ModelError if a value is not as the schema or the model has it."""
    try:
        return _content_of(name, document)
    except ModelError as error:
        text = str(error) if str(error).startswith(f"{name}: ") else f"{name}: {error}"
        found = changes(name, document) if KEY in document else []
        raise ModelError(f"{text} (since it was written: {listed(found)})" if found else text) from None


def _content_of(name: str, document: dict[str, Any]) -> ModelFile:
    content = {key: part for key, part in document.items() if key != KEY}
    try:
        if KEY in document:
            SealFile.model_validate(document[KEY], strict=True)
        found = ModelFile.model_validate_json(json.dumps(content), strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"])
        where = "".join(parts).removeprefix(".") or "the document"
        raise ModelError(f"{name}: {shown(where)}: {first['msg']}: it was changed, or is of another version") from None
    if (found.models if found.kind == "map" else found.maps) or not found.tyres:
        raise ModelError(f"{name}: is of kind {found.kind} and has no entry of it, or one of another: it was changed")
    for entry in found.models:
        _check_model(name, entry)
    for one in found.maps:
        _check_map(name, one)
    return found


def _check_model(name: str, entry: ModelEntry) -> None:
    """ModelError unless the numbers of a model are consistent."""
    model = model_of(entry, name)
    size = len(model.parameters)
    if entry.temperature is not None:
        check_temperature(f"{name}: specimen {shown(entry.tyre)}, temperature", entry.temperature, size)
    for at, one in enumerate(entry.conditions):
        where = f"{name}: specimen {shown(entry.tyre)}, condition {at + 1}"
        if len(one.points) not in (0, len(one.tests)):
            raise ModelError(f"{where}: {len(one.points)} points for {len(one.tests)} tests")
        if len(one.values) != size or len(one.intervals) != size:
            raise ModelError(f"{where}: {len(one.values)} values for {size} parameters")
        model.checked(one.values)
        _check_numbers(where, one.values, one.band)
        _check_amplitude(where, model, one.amplitude)
        check_covariance(where, one.covariance, size)


def _check_map(name: str, entry: MapEntry) -> None:
    """ModelError unless the numbers of a map are consistent."""
    size, terms = len(model_of(entry, name).parameters), len(entry.terms)
    where = f"{name}: specimen {shown(entry.tyre)}"
    if len(entry.coefficients) != size or any(len(one) != terms for one in entry.coefficients):
        raise ModelError(f"{where}: the coefficients are not {terms} for each of {size} parameters")
    _check_axes(where, entry)
    _check_amplitude(where, model_of(entry, name), entry.amplitude)
    _check_numbers(where, [value for row in entry.coefficients for value in row], entry.band)
    check_covariance(where, entry.covariance, size * terms)
    check_offsets(where, entry.offsets, len(entry.axes[0].values) if entry.axes else 1, size)
    if entry.static is not None:
        own = len(entry.static.terms)
        if len(entry.static.coefficients) != own or not _fit_axes(entry.static.terms, entry):
            raise ModelError(f"{where}: the surface of K1 does not fit its terms or the axes")
        check_covariance(f"{where}, K1", entry.static.covariance, own)


def _check_axes(where: str, entry: MapEntry) -> None:
    if not _fit_axes(entry.terms, entry):
        raise ModelError(f"{where}: the terms do not fit the axes")
    if len({len(axis.values) for axis in entry.axes}) > 1 or any(not axis.values for axis in entry.axes):
        raise ModelError(f"{where}: the axes have different numbers of tested conditions")
    if any(axis.logarithmic and min(axis.values) <= 0 for axis in entry.axes):
        raise ModelError(f"{where}: a value on a logarithmic axis is not positive")
    if any(min(axis.values) == max(axis.values) for axis in entry.axes):
        raise ModelError(f"{where}: an axis has one value only")


def _check_numbers(where: str, values: list[float], band: tuple[float, float]) -> None:
    if max(map(abs, values), default=0.0) > LARGEST or band[0] > band[1]:
        raise ModelError(f"{where}: a number is beyond all measure, or the band falls: it was changed")


def _check_amplitude(where: str, model: Model, amplitude: list[float] | None) -> None:
    """ModelError unless rising amplitudes stand where K* of the model depends on them, and only there."""
    falls = amplitude is not None and (len(amplitude) < 2 or any(np.diff(amplitude) <= 0))
    if (amplitude is not None) != model.by_amplitude or falls:
        raise ModelError(f"{where}: the tested amplitudes are missing, do not rise, or are of a model without them")


def _fit_axes(terms: list[list[int]], entry: MapEntry) -> bool:
    """Whether each term has one exponent, from 0 to 9, for each axis."""
    return all(len(one) == len(entry.axes) and all(0 <= power <= 9 for power in one) for one in terms)


def model_of(entry: ModelEntry | MapEntry, name: str = "the model file") -> Model:
    """The model of an entry; ModelError if the parameters of the entry, or their units, differ from the model's."""
    model = model_named(entry.model).with_parameters(len(entry.parameters))
    stated = [one.symbol for one in entry.parameters]
    if stated != model.symbols:
        raise ModelError(f"{name}: the {entry.model} model has the parameters {', '.join(model.symbols)}, not {stated}")
    for own, other in zip(model.parameters, entry.parameters, strict=True):
        if own.unit != other.unit:
            raise ModelError(
                f"{name}: {own.symbol} is in {shown(other.unit)} there, the {entry.model} model has it in {own.unit}: "
                "the file was changed; write it again with fourpole fit or map"
            )
    return model


def model_parts(model: Model) -> dict[str, Any]:
    """Name, causality and parameters of a model as they are in an entry."""
    parameters = [
        ParameterFile(
            **{name: getattr(one, name) for name in ("symbol", "unit", "meaning")},
            low=finite_or_none(one.low),
            high=finite_or_none(one.high),
        )
        for one in model.parameters
    ]
    return {"model": model.name, "causal": model.causal, "parameters": parameters}


def entry_of(
    tyre: str, found: OperatingMap, choice: str, amplitude: Amplitudes = None, inertia: InertiaFile | None = None
) -> MapEntry:
    """A map as it is in a file; `amplitude` is the tested range if the model depends on it."""
    offsets = (
        () if found.offsets is None else zip(*(each.tolist() for each in vars(found.offsets).values()), strict=True)
    )
    errors = found.leave_one_out
    error, inside, conditions = map(finite_or_none, (errors.error, errors.inside, errors.conditions))
    heads = zip(found.axes.names, map(split_column, found.axes.names), found.axes.points.T.tolist(), strict=True)
    axes = [
        AxisFile(name=name, unit=unit, values=values, logarithmic=head in found.axes.logarithmic)
        for head, (name, unit), values in heads
    ]
    return MapEntry(
        tyre=tyre,
        **model_parts(found.model),
        axes=axes,
        constant=NamedValue.of(found.axes.constant),
        terms=[list(one) for one in found.terms],
        coefficients=found.coefficients.tolist(),
        covariance=found.covariance.tolist(),
        scatter=[found.scatter.condition[0], *found.scatter.frequency, found.scatter.condition[1]],
        band=found.band,
        amplitude=amplitude,
        leave_one_out=(error, inside, conditions),
        static=None if found.static is None else SurfaceFile.of(found.static),
        choice=choice,
        inertia=inertia,
        link=found.link,
        offsets=[OffsetFile(value=(value[0], value[1]), covariance=own) for value, own in offsets],
    )


def map_of(entry: MapEntry) -> OperatingMap:
    """The operating map of an entry."""
    model = model_of(entry).with_link(entry.link)
    count = len(entry.axes[0].values) if entry.axes else 1
    points = np.array([axis.values for axis in entry.axes], dtype=float).reshape(len(entry.axes), count).T
    size = sum(len(one) for one in entry.coefficients)
    condition, *frequency = entry.scatter[:3]
    errors = [[*one.value] for one in entry.offsets], [one.covariance for one in entry.offsets]
    return OperatingMap(
        model=model,
        axes=Axes(
            tuple(axis.column for axis in entry.axes),
            points,
            {one.column: one.value for one in entry.constant},
            tuple(axis.column for axis in entry.axes if axis.logarithmic),
        ),
        terms=tuple(tuple(one) for one in entry.terms),
        coefficients=np.array(entry.coefficients, dtype=float).reshape(len(model.parameters), -1),
        covariance=np.array(entry.covariance, dtype=float).reshape(size, size),
        scatter=Scatter(
            (condition, entry.scatter[-1] if entry.scatter[3:] else condition), (frequency[0], frequency[1])
        ),
        band=entry.band,
        leave_one_out=LeaveOneOut(*(float("nan") if one is None else one for one in entry.leave_one_out)),
        static=None if entry.static is None else entry.static.surface(entry.link),
        offsets=Offsets(*map(np.array, errors)) if entry.offsets else None,
    )


def map_of_condition(entry: ModelEntry, one: ConditionFile) -> OperatingMap:
    """The parameters of a condition as a map of one point with its band and covariance."""
    model = model_of(entry)
    linked = model.link(np.array(one.values))
    _, slopes = model.unlink(linked)
    scale = np.divide(1.0, slopes, out=np.zeros_like(slopes), where=np.abs(slopes) > 1e-100)
    covariance = np.array(one.covariance) * np.outer(scale, scale)
    return OperatingMap(
        model=model,
        axes=Axes((), np.zeros((1, 0)), dict(one.coordinates)),
        terms=((),),
        coefficients=linked[:, None],
        covariance=covariance,
        scatter=Scatter(frequency=(entry.discrepancy, entry.discrepancy)),
        band=one.band,
        leave_one_out=LeaveOneOut(),
        offsets=Offsets(np.zeros((1, 2)), np.pad(covariance, (0, 2))[None]),
    )
