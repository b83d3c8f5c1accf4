"""The mass of a specimen in figures: what a massless reading would say, and the modes, against a rig in nodes."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from tests.belted_rig import BeltedRig
from tests.plot.conftest import results_of
from tests.plot.legible import illegible

from fourpole import quantities as q
from fourpole.plot import draw
from fourpole.plot.catalogue import figure_data
from fourpole.plot.data import Role
from fourpole.virtual import CROSS_PLY, RADIAL_PLY

RIG = BeltedRig(moving_mass=15.0, c_rig=15.0, gains=(1, 1, 1), delays=(0, 0, 0))


@pytest.fixture(scope="module")
def belted():
    """The radial-ply replaced by a tyre with a belt; K* of its springs in dynamic.csv."""
    results = results_of(tyres=(CROSS_PLY, RADIAL_PLY), pressures=(170e3,), preloads=(1000.0,))
    own = results.dynamic["tyre"] == RADIAL_PLY.name
    contact, rim = RIG.springs(2 * np.pi * results.dynamic[q.FREQUENCY.head].to_numpy())
    k = 1 / (1 / contact + 1 / rim)
    dynamic = results.dynamic.with_columns(
        pl.when(own).then(pl.Series(part)).otherwise(pl.col(one.head)).alias(one.head)
        for one, part in ((q.STORAGE, k.real), (q.LOSS, k.imag))
    )
    known = {q.BELT_MASS: (7.0, 0.1), q.BELT_FREE: (79.4, 0.6), q.BELT_HELD: (86.9, 0.7), q.BELT_SHARE: (0.2, 0.01)}
    row = {"tyre": RADIAL_PLY.name, "rig": "", "pressure [Pa]": 170e3, "preload [N]": 1000.0, "form": "belt",
           q.BELT_EXPONENT.head: 0.0, q.BELT_EVIDENCE.head: 90.0}  # fmt: skip
    for one, pair in known.items():
        row |= dict(zip(one.heads, pair, strict=True))
    other = dict.fromkeys(row) | {"tyre": CROSS_PLY.name, "form": "massless"}
    return replace(results, tables={**results.tables, "dynamic": dynamic, "specimens": pl.DataFrame([other, row])})


def test_what_a_massless_reading_says_is_the_force_over_the_deflection_on_this_rig(belted):
    panels = figure_data(belted, "storage-loss").panels
    lines = [[one for one in panel.series if one.role is Role.LINE] for panel in panels]
    assert [len(each) for each in lines] == [0, 1, 0, 1]  # of the belted tyre alone
    (real,), (imag,) = lines[1], lines[3]
    for x, read in zip(real.x, real.y + 1j * imag.y, strict=True):
        omega = 2 * np.pi * x
        force, v1, v2 = RIG.test(omega, 0.0, rigid=False)
        assert 1e3 * read == pytest.approx(1j * omega * force / (v1 - v2), rel=2e-3)


def test_the_modes_are_marked_with_u_and_dashed_beyond_the_tests(belted):
    (panel,) = figure_data(belted, "modes").panels
    texts = [one.texts[0] for one in panel.series if one.texts]
    assert texts == ["79.4 ± 1.2 Hz", "86.9 ± 1.4 Hz"]
    within = [one for one in panel.series if one.role is Role.LINE and one.dash == 0]
    assert all(one.x[0] > 9.9 and one.x[-1] < 24.1 for one in within)
    driving, transfer = (max((one for one in panel.series if one.label == name), key=lambda one: one.x.size)
                         for name in ("driving point", "transfer"))  # fmt: skip
    k = np.abs(RIG.specimen(2 * np.pi * 60.0))
    at = np.argmin(np.abs(driving.x - 60.0))
    # K* is that at the middle tested frequency there.
    assert 1e3 * driving.y[at] == pytest.approx(k[0, 0], rel=0.15)
    assert 1e3 * transfer.y[at] == pytest.approx(k[0, 1], rel=0.15)
    assert driving.x[np.argmin(driving.y)] == pytest.approx(79.4, rel=0.03)


def test_nothing_is_drawn_without_a_mass():
    massless = results_of(pressures=(170e3,))
    assert draw(massless, "modes") is None
    assert not [one for one in figure_data(massless, "stiffness").series if one.role is Role.LINE]


@pytest.mark.parametrize("key", ["modes", "stiffness", "storage-loss"])
def test_the_figures_can_be_read(belted, key):
    figure = draw(belted, key)
    FigureCanvasAgg(figure).draw()
    assert not illegible(figure)
