"""The command twoport: all four poles of the specimens, their reciprocity, and the form held against them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from math import hypot, nan
from pathlib import Path

import numpy as np

from fourpole import quantities as q
from fourpole.answer import Answer, Part, Table
from fourpole.app.console import note, progress, warn
from fourpole.app.group import write_with_figure
from fourpole.campaign import read_campaign
from fourpole.core.condition import AXES
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import number
from fourpole.core.specimen import Form
from fourpole.core.specimenfit import UNLIKELY
from fourpole.errors import FileError, FourpoleError
from fourpole.export.uff import write_two_ports
from fourpole.fitting.inertia import bodies_of
from fourpole.fitting.rows import FoundBody
from fourpole.io.folders import make_folder
from fourpole.io.lock import staged
from fourpole.io.published import published
from fourpole.report.digits import PLUS_MINUS, with_u
from fourpole.study.twoports import TwoPort, measure_two_ports, two_port_table

#: Poles of the printed table, with their places.
_SHOWN = {"k11": 0, "k12": 1, "k22": 3}


def run_twoport(campaign: Path, folder: Path | None = None, workers: int | None = None) -> Answer:
    """Find and write the four poles of each specimen and condition."""
    stated = read_campaign(campaign)
    with progress("reducing") as advance:
        cache = campaign / "results" / "cache" if (campaign / "results").is_dir() else None
        found, lacks = measure_two_ports(stated, cache=cache, workers=workers, progress=advance)
    warn(*(f"no four poles of {lack}" for lack in lacks))
    known = _masses_of(campaign / "results")
    held = [_against(two_port, known) for two_port in found]
    files = _written(found, stated.stated.title or stated.folder.name, make_folder(folder or campaign / "twoport"))
    rest = {"lacks": lacks, "masses": held, "written": [str(path) for path in files]}
    written = [("written", path) for path in files]
    return Answer(_shown(found, held), lambda: {"rows": two_port_table(found).to_dicts(), **rest}, written)


def _shown(found: Sequence[TwoPort], held: Sequence[str]) -> Iterator[Part]:
    for two_port, said in zip(found, held, strict=True):
        yield from _show(two_port)
        if said:
            yield said
    yield f"poles are in kN/m, Re and Im; {PLUS_MINUS}, of the worse part"


def _masses_of(results: Path) -> list[FoundBody]:
    """The masses that an analysis found by the joint route; none without one."""
    with suppress(FourpoleError):
        return bodies_of(published(results))
    return []


def _against(two_port: TwoPort, known: Sequence[FoundBody]) -> str:
    """The mass of the form against that by the joint route, as a sentence; empty where either is lacking."""
    test, fit = two_port.test, two_port.form
    place = {axis.column: nan if (value := test.value(axis.name)) is None else value for axis in AXES}
    body = next((one for one in known if one.is_at(test.tyre, place)), None)
    if fit is None or body is None:
        return ""
    mass, std = body.pair(q.BELT_MASS)
    by_tests = f"{with_u(mass, std)} kg by the joint route (results/specimens.csv)"
    if fit.specimen.form is Form.MASSLESS:
        return f"{body.form.value} mass: none here, {by_tests}"
    apart = abs(fit.specimen.mass - mass) / hypot(fit.mass_std, std)
    verdict = "they agree" if apart <= COVERAGE_FACTOR else f"they differ by {apart:.2g} u of their difference"
    return f"{body.form.value} mass: {with_u(fit.specimen.mass, fit.mass_std)} kg here, {by_tests}: {verdict}"


def _written(found: Sequence[TwoPort], title: str, folder: Path) -> list[Path]:
    """Write table, figure and UFF together; the plot room is imported here because that takes a second."""
    from fourpole.plot.plan import two_port_figure

    with staged(folder) as new:
        names = write_with_figure(new, "twoport", two_port_figure(found), {"twoport.csv": two_port_table(list(found))})
        try:
            write_two_ports(found, title, new / "twoport.uff")
            names.append("twoport.uff")
        except FileError as error:
            warn(f"no UFF: {error}")
    return [folder / name for name in names]


def _show(two_port: TwoPort) -> Iterator[Part]:
    """The poles of one condition, what reciprocity says, and the form that describes them."""
    note(*(f"{two_port.name}: {said}" for said in two_port.notes))
    yield two_port.name
    poles = two_port.poles
    values, reach = poles.stiffness.reshape(-1, 4) / 1e3, COVERAGE_FACTOR * poles.std.max(axis=2) / 1e3
    heads = ["f [Hz]", *(head for pole in _SHOWN for head in (f"Re {pole}", f"Im {pole}", "±"))]
    rows = []
    for row, frequency in enumerate(poles.frequency.tolist()):
        cells = [number(frequency)]
        for at in _SHOWN.values():
            cells += [number(values[row, at].real), number(values[row, at].imag), number(reach[row, at], 2)]
        rows.append(cells)
    yield Table(heads, rows, right=heads)
    yield _reciprocity(two_port)
    if two_port.form is not None:
        yield _form(two_port)


def _reciprocity(two_port: TwoPort) -> str:
    """What the difference of k12 and k21 says, and what to do where they differ."""
    measured = two_port.measured
    off = np.abs(measured.determinant - 1)
    if two_port.reciprocal:
        most = f"k12/k21 is within {100 * float(off.max()):.2g} % of 1"
        return f"Reciprocity holds within the uncertainty ({_p(two_port.chance)}; {most}): k12 = k21 is used"
    worst = int(np.argmax(off / np.hypot(*measured.determinant_std.T)))
    value, std = 100 * float(off[worst]), 100 * float(np.hypot(*measured.determinant_std[worst]))
    return (
        f"Reciprocity is broken: k12/k21 differs from 1 by {with_u(value, std)} % at "
        f"{measured.frequency[worst]:.4g} Hz ({_p(two_port.chance)}). The poles are as measured. A passive specimen "
        "is reciprocal: check that the sensors and their mountings were the same with blocks and specimen, that blocks "
        "and added masses were rigid and firmly fixed, that their weights are right, and that the specimen is linear "
        "at the amplitudes of the tests"
    )


def _form(two_port: TwoPort) -> str:
    """The form that describes the poles best, and whether it does."""
    fit = two_port.form
    assert fit is not None
    name = "massless spring" if fit.specimen.form is Form.MASSLESS else fit.specimen.form.value
    mass = "" if fit.specimen.form is Form.MASSLESS else f" of {with_u(fit.specimen.mass, fit.mass_std)} kg"
    if not two_port.form_fits:
        return (
            f"No form describes the poles within their uncertainty; the best is a {name}{mass} ({_p(fit.chance)}). "
            "Take the measured poles, not K* of one spring. State input_mass and tyre_mass if parts that are mounted "
            "with the specimen are not in them"
        )
    first = ""
    if fit.specimen.form is Form.BELT:
        middle = fit.stiffness[[fit.stiffness.size // 2]]
        free, held = fit.specimen.frequencies(middle)[0]
        first = f"; its frequency with the rim held is {free:.4g} Hz with the contact free, {held:.4g} Hz with it held"
    return f"A {name}{mass} describes the poles within their uncertainty ({_p(fit.chance)}){first}"


def _p(chance: float) -> str:
    return f"p-value {chance:.2g}" if chance >= UNLIKELY else f"p-value below {UNLIKELY:g}"
