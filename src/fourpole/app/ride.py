"""The command ride: a vehicle drives over a road on the tyres of models."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole import units
from fourpole.answer import Answer, Part, Table
from fourpole.app.console import option, progress, say, warn
from fourpole.app.group import write_with_figure
from fourpole.app.options import RideOptions
from fourpole.campaign.vehicle import StatedVehicle, vehicle_named
from fourpole.core.arrays import FloatArray
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import number
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.specimen import Form
from fourpole.errors import UnitError
from fourpole.findings.conformity import is_pulled, is_told, most_outside, other_preloads, other_tangents, too_short
from fourpole.fitting.inertia import belt_stated
from fourpole.fitting.placed import operating_point
from fourpole.fitting.ridetyres import RideTyre, tyres_for_ride
from fourpole.io.folders import model_in
from fourpole.io.lock import staged
from fourpole.io.tables.pair import read_curve, read_profile
from fourpole.io.write import write_text
from fourpole.quantities import FREQUENCY, K1, PRELOAD, RIDE_MEASURES, TYRE, C, Quantity, ShownUnits
from fourpole.report.digits import PLUS_MINUS, with_u
from fourpole.ride.compare import REALISED, RideComparison, compare_in_time, compare_on_class
from fourpole.ride.contact import LoadDeflection
from fourpole.ride.road import CLASSES, ClassRoad, Profile, check_speed, cleat, pothole, sine_sweep
from fourpole.ride.time import axles
from fourpole.ride.vehicle import Body
from fourpole.study.record import units_beside

#: Speed where none is stated [m/s].
_SPEED = 80 / 3.6
#: Step of a ride in time [s], of one that is not linear, and of such a one on a road with edges.
_STEP, _FINE, _EDGES = 5e-4, 2.5e-4, 1.25e-4
#: Where no step is stated: samples per cycle of a sweep at its highest frequency; most samples of a measured road, and
#: least step of it [s].
_PER_CYCLE, _MOST_BY_ITSELF, _LEAST = 50.0, 1_000_000, 1e-6
#: Time that a ride goes on after a cleat or a pothole [s].
_AFTER = 3.0
#: Most sentences on differences.
_MOST_SENTENCES = 12
#: Most parts of a path in a label.
_MOST_PARTS = 6
#: Percentage that is shown as zero.
_NOTHING = 1e-6
#: Measures of the printed table, in its order.
_PRINTED = ("comfort", "wheel load", "wheel load front", "wheel load rear", "travel", "travel front", "travel rear",
            "power", "crest", "vdv")  # fmt: skip
#: Roles of the columns of a road.
_OF_ROAD = ("distance", "height")
_ROADS = (
    'a class A to H, a file with distance and height, "cleat 10 mm, 50 mm" or "pothole 30 mm, 500 mm" (height and '
    'length), or "sweep 1 mm, 0.5:20 Hz, 60 s"'
)


@dataclass(frozen=True, eq=False)
class _Road:
    """A road: its words, and either a spectrum, a profile, or a sweep: amplitude [m], lowest and highest frequency
    [Hz] and duration [s].

    `after` is the time that the ride goes on after the last point of a profile [s].
    """

    words: str
    spectrum: ClassRoad | None = None
    profile: Profile | None = None
    sweep: tuple[float, float, float, float] | None = None
    after: float = 0.0


def run_ride(models: list[Path], road: str = "C", speed: float | None = None, *, options: RideOptions) -> Answer:
    """Drive one vehicle over one road on the tyres of all models, and write the files."""
    speed = _SPEED if speed is None else speed
    check_speed(speed)
    stated, way = vehicle_named(options.vehicle), _road(road, _columns(options, of_road=True))
    step = _step(options, way, speed)
    states = [operating_point(text) for text in options.at or ()]
    wanted, belt = units_beside(model_in(models[0])), belt_stated(options.belt_mass, options.belt_share)
    tyres = [
        one
        for path in models
        for one in tyres_for_ride(path, states, specimen=options.tyre, beyond=options.beyond, units=wanted, belt=belt)
    ]
    labels = _labels(tyres, wanted)
    matched = [float(np.sqrt(low * high)) for low, high in (one.band for one in tyres)]
    curve = _curve(options.curve, _columns(options, of_road=False))
    asked = _Asked(stated, way.words, speed, labels, tyres, matched, wanted, curve)
    found = _ridden(asked, way, step, options)
    notes = list(_notes(asked, found))
    files = _written(options.folder, asked, found, notes) if options.folder is not None else []
    written = {"written": [str(path) for path in files]}
    return Answer(
        _show(asked, found, notes),
        lambda: {**_document(asked, found, notes), **written},
        [("written", path) for path in files],
    )


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is compared: the vehicle, the road, the speed [m/s], the tyres, and where dampers have their K* [Hz]."""

    vehicle: StatedVehicle
    road: str
    speed: float
    labels: list[str]
    tyres: list[RideTyre]
    matched: list[float]
    units: ShownUnits
    curve: LoadDeflection | None = None

    @property
    def said(self) -> str:
        return f"{self.vehicle.name}, {self.road}, {3.6 * self.speed:.4g} km/h"


def _ridden(asked: _Asked, way: _Road, step: float, options: RideOptions) -> RideComparison:
    """The rides of all tyres: in time, or else by the spectrum of a road class."""
    body, tyres = asked.vehicle.vehicle.body, [one.tyre for one in asked.tyres]
    if way.spectrum is not None and options.duration is None:
        if options.lift_off or asked.curve is not None:
            raise UnitError('--lift-off and --curve need a ride in time: state --duration, as "60 s"')
        with progress("riding"):
            return compare_on_class(body, tyres, way.spectrum, asked.speed, asked.matched)
    with progress("riding") as advance:
        heights = _heights(way, body, asked.speed, step, options)
        return compare_in_time(
            body, tyres, heights, step, asked.matched, lift=options.lift_off, curve=asked.curve, progress=advance
        )


def _step(options: RideOptions, way: _Road, speed: float) -> float:
    """The time step [s]: the usual one, or a shorter one that has a sample for each point of the road."""
    if options.step is not None:
        return options.step
    usual = _STEP
    if options.lift_off or options.curve is not None:
        usual = _FINE if way.profile is None else _EDGES
    if way.sweep is not None:
        return min(usual, 1.0 / (_PER_CYCLE * way.sweep[2]))
    if way.profile is None:
        return usual
    duration = way.profile.length / speed + way.after
    return min(usual, max(way.profile.spacing / speed, duration / _MOST_BY_ITSELF, _LEAST))


def _columns(options: RideOptions, *, of_road: bool) -> list[str]:
    """The statements of ``--column`` on a road, or the others."""
    return [text for text in options.column or () if (text.partition("=")[0].strip() in _OF_ROAD) is of_road]


def _road(text: str, columns: Sequence[str]) -> _Road:
    """The road of the option ``--road``."""
    word, _, rest = text.strip().partition(" ")
    if text.strip().upper() in tuple(CLASSES):
        letter = text.strip().upper()
        return _Road(f"road class {letter}", spectrum=ClassRoad.of(letter))
    if word in ("cleat", "pothole", "sweep") and rest:
        parts = [part.strip() for part in rest.split(",")]
        if len(parts) != (3 if word == "sweep" else 2):
            raise UnitError(f"--road: {units.shown(text)} is no road: it is {_ROADS}")
        size = option(parts[0], "displacement", "--road", "positive")
        if word == "sweep":
            low, high = units.frequency_band(parts[1])
            return _Road(text, sweep=(size, low, high, option(parts[2], "time", "--road", "positive")))
        made = cleat if word == "cleat" else pothole
        return _Road(text, profile=made(size, option(parts[1], "displacement", "--road", "positive")), after=_AFTER)
    path = Path(text)
    if not path.is_file():
        raise UnitError(f"--road: {units.shown(text)} is neither a file nor a road: it is {_ROADS}")
    table = read_profile(path, columns=columns)
    say(*(f"understood {line}" for line in table.understood))
    warn(*table.warnings)
    return _Road(path.name, profile=Profile(table.distance, table.height, path.name))


def _heights(way: _Road, body: Body, speed: float, step: float, options: RideOptions) -> FloatArray:
    """Heights (W, N) [m] of the road under each axle over time."""
    if way.profile is not None:
        lags = (body.behind / speed).tolist()
        return np.stack([way.profile.in_time(speed, step, way.after, late) for late in lags])
    if way.sweep is not None:
        return axles(sine_sweep(*way.sweep, step), body, speed, step)
    assert way.spectrum is not None
    assert options.duration is not None
    return axles(way.spectrum.realisation(options.duration, step, speed, options.seed), body, speed, step)


def _curve(path: Path | None, columns: Sequence[str]) -> LoadDeflection | None:
    """The load-deflection curve of a static test: the mean of its branches, from zero load on."""
    if path is None:
        return None
    table = read_curve(path, columns=columns)
    deflection, load = LoadCurve(table.deflection, table.load).mean_curve(200)
    rising = np.flatnonzero(load > 0)
    return LoadDeflection(deflection[rising], load[rising])


def _labels(tyres: Sequence[RideTyre], wanted: ShownUnits) -> list[str]:
    """A text for each tyre: its specimen and what differs between them.

    Where that is the same, the model or the file is added; what is still the same is numbered.
    """
    columns = [column for one in tyres for column in one.state]
    differing = [column for column in dict.fromkeys(columns) if len({one.state.get(column) for one in tyres}) > 1]
    texts = []
    for one in tyres:
        parts = [wanted.setting(column, one.state[column]) for column in differing if column in one.state]
        texts.append(", ".join(filter(None, (one.specimen, *parts))) or one.label)
    for words in ([one.tyre.model.name for one in tyres], _files(tyres)):
        kinds = set(zip(texts, words, strict=True))
        texts = [
            f"{text}, {word}" if sum(other == text for other, _ in kinds) > 1 else text
            for text, word in zip(texts, words, strict=True)
        ]
    return [
        text if texts.count(text) == 1 else f"{text} ({texts[: at + 1].count(text)})" for at, text in enumerate(texts)
    ]


def _files(tyres: Sequence[RideTyre]) -> list[str]:
    """The file of each tyre, by as much of its path as tells it from the others."""
    parts = [one.place.parts for one in tyres]
    enough = (n for n in range(1, _MOST_PARTS) if len({each[-n:] for each in parts}) == len(set(parts)))
    depth = next(enough, _MOST_PARTS)
    return [str(Path(*each[-depth:])) for each in parts]


def _notes(asked: _Asked, found: RideComparison) -> Iterator[str]:
    """What a reader of the numbers must know, each once."""
    yield from dict.fromkeys(remark for one in asked.tyres for remark in one.remarks)
    belts = dict.fromkeys(one.tyre.belt.mass for one in asked.tyres if one.tyre.belt.form is Form.BELT)
    if belts:
        masses = ", ".join(f"{mass:.4g} kg" for mass in belts)
        yield f"the belt of the tyre, {masses}, is taken out of the unsprung mass of the vehicle"
    if max(found.approximated, default=0.0) > 0:
        at = int(np.argmax(found.approximated))
        low, high = REALISED
        yield (
            f"{asked.labels[at]}: the {asked.tyres[at].tyre.model.name} model is ridden as Maxwell arms, whose K* "
            f"differs by up to {found.approximated[at]:.1g} of |K*| from {low:g} to {high:g} Hz"
        )
    if (outside := most_outside(found, [tyre.band for tyre in asked.tyres])) is not None:
        worst, share = outside
        low, high = asked.tyres[worst].band
        yield (
            f"{100 * share:.0f} % of the mean square of a_w ({asked.labels[worst]}) is from frequencies "
            f"outside the tested ones, {low:.4g} to {high:.4g} Hz: there K* is what the model predicts"
        )
    loads = asked.vehicle.vehicle.body.loads
    if others := other_preloads([tyre.preload for tyre in asked.tyres], loads):
        preloads = dict.fromkeys(asked.units.text(PRELOAD, preload) for preload in others)
        own = " and ".join(asked.units.text(PRELOAD, load) for load in loads.tolist())
        yield (
            f"the static load of a wheel is {own}, the preload of the tyres {', '.join(preloads)}: choose an operating "
            "point at that load"
        )
    if asked.curve is not None:
        yield from _curve_notes(asked, asked.curve)
    yield from _contact_notes(found, loads)
    if (duration := too_short(found)) is not None:
        yield f"the ride lasts {duration:.2g} s, less than one cycle at 0.4 Hz, the lowest frequency of Wk"


def _contact_notes(found: RideComparison, loads: FloatArray) -> Iterator[str]:
    """Whether wheels leave the road or tyres their curve, or would leave the road."""
    if found.contact:
        air, beyond = (max(float(np.max(getattr(one, name))) for one in found.contact) for name in ("in_air", "beyond"))
        if air > 0:
            yield f"a wheel is in the air for up to {100 * air:.2g} % of the time"
        if beyond > 0:
            yield f"a tyre is beyond the curve, which goes on straight, for up to {100 * beyond:.2g} % of the time"
    elif is_pulled(found, loads):
        yield (
            "a wheel would leave the road, which pulls it down in this ride: state --lift-off, on a road class with "
            "--duration, and check the unit of the road's height"
        )


def _curve_notes(asked: _Asked, curve: LoadDeflection) -> Iterator[str]:
    """Where the tangent of the curve at the static load is not the stiffness of a model at rest."""
    for label, one in zip(asked.labels, asked.tyres, strict=True):
        rest = float(one.tyre.model.static_stiffness(one.tyre.values))
        for load, tangent in other_tangents(curve, rest, asked.vehicle.vehicle.body.loads):
            curved, straight = (asked.units.text(K1, k) for k in (tangent, rest))
            yield (
                f"{label}: the tangent of the curve at {asked.units.text(PRELOAD, load)} is {curved}, "
                f"the model at rest has {straight}: they may be of different tyres or pressures"
            )


def _sentences(asked: _Asked, found: RideComparison) -> Iterator[str]:
    """For each further tyre whether it is more comfortable than the first, and by how much."""
    at, first = found.names.index("comfort"), asked.labels[0]
    pairs = zip(asked.labels, found.difference[:, at].tolist(), found.difference_std[:, at].tolist(), strict=True)
    for label, apart, std in list(pairs)[1 : _MOST_SENTENCES + 1]:
        if not is_told(apart, std):
            yield f"{label}: no difference in a_w from {first} can be told"
        else:
            less = "less" if apart > 0 else "more"
            yield f"{label} is {less} comfortable than {first}: a_w differs by {with_u(100 * apart, 100 * std)} %"


def _show(asked: _Asked, found: RideComparison, notes: Sequence[str]) -> Iterator[Part]:
    """The measures with U, the differences from the first tyre, what a constant damper gets wrong, and notes."""
    yield f"Ride: {asked.said}"
    columns = [
        (found.names.index(name), asked.units.of(RIDE_MEASURES[name])) for name in _PRINTED if name in found.names
    ]
    heads = ["tyre", *(f"{one.symbol or one.name}{_place(one)} [{one.shown}]" for _, one in columns)]
    rows = [
        [label, *(with_u(values[at], std[at], one.scale) for at, one in columns)]
        for label, values, std in zip(asked.labels, found.values, found.std, strict=True)
    ]
    yield Table(heads, rows, right=heads[1:])
    if len(asked.labels) > 1:
        yield ""
        yield f"Difference from {asked.labels[0]}, in %"
        rows = [
            [label, *(with_u(100 * values[at], 100 * std[at]) for at, _ in columns)]
            for label, values, std in list(zip(asked.labels, found.difference, found.difference_std, strict=True))[1:]
        ]
        yield Table(_percent(heads), rows, right=_percent(heads)[1:])
    yield PLUS_MINUS
    yield from _sentences(asked, found)
    yield ""
    yield "Error of a spring and a constant damper instead of the model, with K* of the model at one frequency, in %"
    spring, damper = asked.units.of(K1), asked.units.of(C)
    head = ["tyre", f"at [{FREQUENCY.unit}]", f"K [{spring.shown}]", f"C [{damper.shown}]", *_percent(heads)[1:]]
    rows = [
        [
            label,
            number(f, 3),
            number(k / spring.scale, 4),
            number(c / damper.scale, 4),
            *(_signed(100 * wrong[at]) for at, _ in columns),
        ]
        for label, f, (k, c), wrong in zip(
            asked.labels, asked.matched, found.damper.tolist(), found.with_damper, strict=True
        )
    ]
    yield Table(head, rows, right=head[1:])
    warn(*notes)


def _signed(value: float) -> str:
    """A percentage to two digits with its sign; blank if it is no number."""
    if not np.isfinite(value):
        return ""
    value = 0.0 if abs(value) < _NOTHING else value
    return f"{'−' if value < 0 else '+'}{number(abs(value), 2)}"


def _percent(heads: Sequence[str]) -> list[str]:
    return [heads[0], *(f"{head.partition(' [')[0]} [%]" for head in heads[1:])]


def _place(one: Quantity) -> str:
    return f" {one.key.rpartition(' ')[2]}" if one.symbol and one.key.endswith((" front", " rear")) else ""


def _rows(asked: _Asked, found: RideComparison) -> list[dict[str, Any]]:
    """The table in SI, a row per tyre."""
    rows = []
    for at, one in enumerate(asked.tyres):
        row: dict[str, Any] = {TYRE.head: one.specimen, "label": asked.labels[at], **one.state}
        for place, name in enumerate(found.names):
            quantity = RIDE_MEASURES[name]
            row |= dict(zip(quantity.heads, (found.values[at, place], found.std[at, place]), strict=True))
            difference = f"difference in {quantity.column}"
            row |= {f"{difference} [1]": found.difference[at, place]}
            row |= {f"u({difference}) [1]": found.difference_std[at, place]}
            row |= {f"error in {quantity.column} by a constant damper [1]": found.with_damper[at, place]}
        row |= {"damper matched at [Hz]": asked.matched[at]}
        row |= {"spring beside the damper [N/m]": found.damper[at, 0], "constant damper [N s/m]": found.damper[at, 1]}
        if found.contact:
            row |= {"time in the air [1]": float(np.max(found.contact[at].in_air))}
        rows.append({name: _finite(value) for name, value in row.items()})
    return rows


def _finite(value: Any) -> Any:
    """A value of a table as a plain one; None for a number that is none."""
    return (float(value) if np.isfinite(value) else None) if isinstance(value, (float, np.floating)) else value


def _document(asked: _Asked, found: RideComparison, notes: Sequence[str]) -> dict[str, Any]:
    return {
        "vehicle": {"name": asked.vehicle.name, "source": asked.vehicle.source, **vars(asked.vehicle.vehicle)},
        "road": asked.road,
        "speed [m/s]": asked.speed,
        "coverage factor of U": COVERAGE_FACTOR,
        "rides": _rows(asked, found),
        "findings": list(_sentences(asked, found)),
        "notes": list(notes),
    }


def _written(folder: Path, asked: _Asked, found: RideComparison, notes: Sequence[str]) -> list[Path]:
    """Write the table, the document and the figure. The plot room is imported here because that takes a second."""
    import json

    from fourpole.io.folders import make_folder
    from fourpole.plot.ride import draw_ride, ride_figure

    folder = make_folder(folder)
    figure = draw_ride(ride_figure(found, asked.labels, [asked.said]))
    table = pl.DataFrame(_rows(asked, found), infer_schema_length=None)
    with staged(folder) as new:
        write_with_figure(new, "ride", figure, {"ride.csv": table})
        write_text(new / "ride.json", json.dumps(_document(asked, found, notes), indent=1, ensure_ascii=False) + "\n")
    return [folder / f"ride.{form}" for form in ("csv", "json", "svg", "png")]
