"""Numbers that decide a warning of an export, or what a format takes: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from contextlib import suppress
from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import polars as pl
import pytest
from tests.export.fmus import MODELS, instance, made, unpacked

from fourpole.errors import FourpoleError
from fourpole.export import fmi, materials
from fourpole.export.kinds import _misfits
from fourpole.export.lookup import _Sheet
from fourpole.export.netcdf import _dynamic_grid
from fourpole.export.systems import System, _approximated
from fourpole.export.tir import vertical
from fourpole.export.workbook import _parts
from fourpole.fitting.modelfile import ModelFile


def taken(function):
    """A function that gives whether another one takes a case without an error."""

    def decided(case):
        try:
            function(case)
        except FourpoleError:
            return False
        return True

    return decided


def warned(discrepancy):
    """Number of warnings about a model that is off by this."""
    source = MagicMock(spec=ModelFile, models=[MagicMock(conditions=[1])], maps=[])
    with patch("fourpole.fitting.accuracy.accuracy_of", return_value=MagicMock(discrepancy=discrepancy)):
        return len(_misfits(source, None))


def approximated(error):
    """Whether a system is said to approximate its model, in a note and in its name."""
    one = MagicMock(placed=MagicMock(band=(1.0, 10.0)), realised=SimpleNamespace(error=error), belted=False)
    return len(_approximated([one])), "approximated" in System.about.fget(one)


def points(error):
    """Number of points of a table, by the error of interpolation."""
    sheet = SimpleNamespace(sides=[(1.0, 100.0, True)], error=lambda grid, along: error)
    return _Sheet.grid(sheet)[0].size


def by_load(apart):
    """Whether the stiffness of a tyre depends on its load, by the relative difference of two loads."""
    load, pressure = np.array([1e3, 1e3 * (1 + apart)]), np.full(2, np.nan)
    return bool(vertical(np.array([1e5, 1.1e5]), load, pressure, 0).load_term)


def written(count):
    """Write an FMU of some operating points."""
    parts = dict.fromkeys(("_point", "draws_in", "_described", "write_bytes"), MagicMock(return_value=((), ())))
    given = {"systems_of": lambda *given, **how: ([MagicMock()] * count, ()), "fmu": lambda *given: (b"", ())}
    with patch.multiple(fmi, **parts, **given):
        fmi.write(None, MagicMock())


def gridded(names):
    """The grid of a test of 1000 pressures and some specimens."""
    at = np.zeros(1, dtype=int)
    places = dict.fromkeys(("tyre", "pressure", "load", "frequency", "setting"), at)
    sheet = SimpleNamespace(
        names=range(names), pressures=range(1000), loads=[1], frequencies=[1], settings=[], **places
    )
    return _dynamic_grid(SimpleNamespace(sheet=sheet, repeats=at), "grid")


def arms(write):
    """A function that writes a material of so many arms for a program."""

    def writing(count):
        one = MagicMock(arms=SimpleNamespace(springs=np.ones(count), times=np.geomspace(1e-3, 1.0, count)))
        with patch.multiple(
            materials, materials_of=lambda *given: ([one], ()), _write=MagicMock(), no_moduli=lambda given: ()
        ):
            write(None, None)

    return writing


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "model discrepancy of which an export warns, 3 %": (warned, {0.0297: 0, 0.0303: 1}),
    "system that approximates its model, 1e-9": (approximated, {0.99e-9: (0, False), 1.01e-9: (1, True)}),
    "interpolation of a table, 0.1 %, in at most 50 000 rows": (points, {0.99e-3: 3, 1.01e-3: 32769}),
    "loads that differ, 2 %": (by_load, {0.0198: False, 0.0202: True}),
    "operating points of an FMU, 100": (taken(written), {100: True, 101: False}),
    "cells of a grid, 2 millions": (taken(gridded), {2000: True, 2001: False}),
    "rows of a sheet of a workbook, 1 048 575": (
        lambda rows: len(list(_parts("a", pl.DataFrame({"a": np.zeros(rows)})))), {1_048_575: 1, 1_048_576: 2},
    ),
    "arms of ANSYS, 100": (taken(arms(materials.write_ansys)), {100: True, 101: False}),
    "arms of LS-DYNA, 17 beside the modulus at rest": (taken(arms(materials.write_lsdyna)), {17: True, 18: False}),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """An FMU of a spring and a damper."""
    pytest.importorskip("fmpy", reason="FMPy needs a later numpy than the lowest version allowed")
    place = tmp_path_factory.mktemp("fmu")
    return unpacked(made(place, 2, {"kelvin": MODELS["kelvin"]}), place / "2")


@pytest.mark.parametrize(
    ("first", "duration", "cases"),
    [(1e-3, 1e-3, {0.99e-9: True, 1.01e-9: False}), (1e3, 1e-6, {0.99e-6: True, 1.01e-6: False})],
    ids=["a millionth of the step", "1e-9 of the time"],
)
def test_a_step_begins_where_the_last_one_ended_and_ends_before_the_experiment(folder, first, duration, cases):
    from fmpy.fmi1 import FMICallException

    for stop in (None, first + duration):
        found = {}
        for off in cases:
            with instance(folder, 2) as one:
                one.start(stop=stop)
                one.step(0.0, first)
                with suppress(FMICallException):
                    one.step(first + (off if stop is None else 0.0), duration + (0.0 if stop is None else off))
                found[off] = not one.said
        assert found == cases
