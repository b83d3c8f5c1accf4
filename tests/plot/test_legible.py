"""Every figure can be read at every size: no text lies on another, and none is cut by the edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.plot.conftest import results_of
from tests.plot.legible import illegible
from tests.plot.modelled import against, elastomer, of_each, study_with_models, with_models
from tests.plot.rig_found import UNSTATED, VALUES, rig_table
from tests.plot.test_amplitude import over_amplitudes

from fourpole.plot import FIGURES, SIZES, Style, draw
from fourpole.plot.layout import new_figure
from fourpole.virtual import RADIAL_PLY

pytestmark = pytest.mark.thorough

#: Figures of what these results do not have: such models ("spectrum" and "amplitude"), recordings, masses of specimens.
OTHERS = ("spectrum", "amplitude", "signals", "modes")
#: Figures that differ from the one before in the preload alone.
AGAIN = ("fig07", "fig09", "fig11", "fig13")
KEYS = tuple(key for key in FIGURES if key not in (*OTHERS, *AGAIN))
#: Figures that these results may lack.
LACKING = ("pressure-frequency", "map", "model-choice")


@pytest.fixture(scope="module")
def usual():
    """Two specimens, 30 tests each, with models that were chosen of two, and maps."""
    return against(study_with_models(), "fractional")


@pytest.fixture(scope="module")
def many():
    """Six specimens of long names at nine pressures, alike in all else, and values of the rig that nobody stated."""
    names = [f"a tyre of the long name {at}" for at in range(6)]
    tyres = [replace(RADIAL_PLY, name=name) for name in names]
    states = {"pressures": np.linspace(100e3, 240e3, 9), "frequencies": (10.0, 14.0, 18.0, 24.0)}
    one = against(with_models(results_of(tyres=tyres[:1], **states), "kelvin"), "zener")
    far = {"moving_mass": ("kg", 15.0, 0.01, 15.81, 0.81, 81.0, None, "contradicted")}
    return replace(
        results_of(tyres=tyres, **states),
        models=of_each(one.models, names),
        maps=of_each(one.maps, names),
        rig=rig_table({**VALUES, **far, **UNSTATED}),
    )


@pytest.fixture(scope="module")
def one():
    return results_of(tyres=(RADIAL_PLY,), pressures=(170e3,), preloads=(1000.0,), frequencies=(14.0,))


#: The most texts at each size; fewer of them once, and the fewest.
CASES = [("one", "journal"), ("usual", "report"), *(("many", size) for size in SIZES)]


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize(("case", "size"), CASES)
@pytest.mark.sampled(8)
def test_no_text_lies_on_another_or_is_cut(request, case, key, size):
    figure = draw(request.getfixturevalue(case), key, Style(size=SIZES[size]))
    if figure is None:
        assert case == "one"
        assert key in LACKING
        return
    assert illegible(figure) == []


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("key", ["spectrum", "amplitude"])
@pytest.mark.sampled(4)
def test_nor_in_the_figures_of_further_models(key, size):
    results = over_amplitudes() if key == "amplitude" else elastomer(model="prony:2")
    assert illegible(draw(results, key, Style(size=SIZES[size]))) == []


def test_what_cannot_be_read_is_found():
    figure = new_figure(2.0, 1.0)
    figure.text(0.3, 0.5, "one text")
    figure.text(0.4, 0.5, "another")
    figure.text(0.95, 0.1, "cut")
    assert illegible(figure) == ["cut: 'cut'", "'one text' on 'another'"]
