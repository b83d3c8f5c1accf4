"""The shape of a specimen: moduli from stiffness, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from fourpole.models.shape import Shape, shape_of


def test_a_block_in_compression_and_in_shear():
    stated = {"height": "10 mm", "area": "5 cm^2", "poisson": 0.25}
    block = shape_of({**stated, "mode": "compression"})
    assert (block.young, block.shear) == pytest.approx((20.0, 8.0))
    assert block.bulk_modulus == pytest.approx(20.0 / 1.5)
    block = shape_of({**stated, "mode": "shear"})
    assert (block.shear, block.young) == pytest.approx((20.0, 50.0))


def test_a_bonded_disc_is_the_printed_example():
    """Diameter 4 times the height: S = 1, so that E is a third of K h/A with k = 1."""
    area = np.pi * 0.02**2
    disc = Shape("compression", 0.01, area, bonded="disc")
    assert disc.factor == pytest.approx(1.0)
    assert disc.modulus == pytest.approx(0.01 / area / 3)
    assert Shape("compression", 0.01, area, bonded="disc", bonded_factor=0.5).modulus == pytest.approx(0.01 / area / 2)


def test_without_a_mode_nothing_is_assumed():
    assert shape_of({"height": "10 mm", "area": "5 cm^2", "construction": "mount"}) is None


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"mode": "bending", "height": "1 mm", "area": "1 mm^2"}, "is not compression or shear"),
        ({"mode": "shear", "height": "1 mm"}, "so area must be, with its unit"),
        ({"mode": "shear", "height": 10, "area": "1 mm^2"}, "so height must be, with its unit"),
        ({"mode": "shear", "height": "1 mm", "area": "1 mm"}, "area is needed"),
        ({"mode": "shear", "height": "0 mm", "area": "1 mm^2"}, "height must be positive"),
        ({"mode": "shear", "height": "1 mm", "area": "1 mm^2", "poisson": 0.5}, "below 0.5"),
        ({"mode": "shear", "height": "1 mm", "area": "1 mm^2", "poisson": True}, "poisson is no number"),
        ({"mode": "shear", "height": "1 mm", "area": "1 mm^2", "bonded": "disc"}, "one of mode = "),
        ({"mode": "shear", "height": "1 mm", "area": "1 mm^2", "bulk": "soft"}, "is not elastic or relaxing"),
    ],
)
def test_what_is_no_shape(stated, said):
    with pytest.raises(ValueError, match=said):
        shape_of(stated)


def test_moduli_that_need_poissons_ratio_say_so():
    block = Shape("shear", 0.01, 5e-4)
    assert block.shear == 20.0
    with pytest.raises(ValueError, match="Poisson's ratio is not stated"):
        _ = block.young
