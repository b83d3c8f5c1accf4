"""The table of quantities: each head once, each name where it belongs."""

from collections import Counter

import pytest

from fourpole import quantities
from fourpole.quantities import (
    LOSS_FACTOR,
    NONLINEARITY,
    QUANTITIES,
    STORAGE,
    TEMPERATURE,
    TR_MEASURED,
    TR_PREDICTED,
    Quantity,
)
from fourpole.units import quantity
from fourpole.units.kinds import TABLE


def test_no_two_quantities_share_a_head_or_a_key():
    assert [head for head, count in Counter(one.head for one in QUANTITIES).items() if count > 1] == []
    assert [key for key, count in Counter(one.key for one in QUANTITIES).items() if count > 1] == []


SCALED = [one for one in QUANTITIES if one.scale != 1.0]


@pytest.mark.parametrize("one", SCALED, ids=lambda one: one.key)
def test_the_scale_is_what_one_shown_unit_is_worth(one):
    kinds = {name for name, kind in TABLE.items() if kind.si == one.unit}
    assert kinds
    for kind in kinds:
        assert quantity(f"1 {one.shown}", kind) == pytest.approx(one.scale, rel=1e-12)


def test_heads_labels_and_suffixes():
    assert STORAGE.heads == ("Re K* [N/m]", "u(Re K*) [N/m]")
    assert STORAGE.label == "K' [kN/m]"
    assert TR_MEASURED.u_head == TR_PREDICTED.u_head == "u(TR) [1]"
    assert (LOSS_FACTOR.suffix, NONLINEARITY.suffix, TEMPERATURE.suffix) == ("", "%", "°C")
    assert quantities.F1.parts == ("Re F1 [N]", "Im F1 [N]")


def test_a_quantity_of_a_few_words_has_all_its_texts():
    one = Quantity("specific_loss", "ψ", "specific loss", "1")
    assert (one.head, one.u_head, one.label) == ("specific loss [1]", "u(specific loss) [1]", "specific loss [1]")
    assert (one.more, one.start) == ("has the larger specific loss", "Specific loss")
