"""The claims of the paper in words: each sentence is held by one test here."""

import pytest
from tests.report.test_words import AXES, effects, said, trend

from fourpole.findings import Finding, Holds, Topic
from fourpole.findings.trends import Effect
from fourpole.paper1982.claims import (
    Above,
    ApartAt,
    Claim,
    Isolation,
    Lack,
    Likewise,
    Need,
    NoCommonState,
    Nonlinear,
    OptimumAt,
    Order,
    Turning,
    TurningAt,
)
from fourpole.paper1982.words import STATEMENTS, summary
from fourpole.quantities import K1, K2, C


def claimed(found, holds=Holds.TRUE, number=1):
    return said(Claim(number, ("X", "radial-ply"), ("", " at 20 °C"), found), holds)


def stated(number):
    return STATEMENTS[number].format(a="the cross-ply (X)", b="the radial-ply at 20 °C")


@pytest.mark.parametrize(
    ("number", "statement"),
    [
        *enumerate(
            [
                "K1 of {a} is above that of {b}",
                "{a} is markedly non-linear under static load, {b} nearly linear",
                "C of {a} has its maximum near 1.68 bar",
                "C of {b} rises with pressure",
                "at high pressure C is higher under the low load, at low pressure the loads hardly differ",
                "C of {b} rises with frequency from 10 to 24 Hz",
                "C of {a} is above that of {b}",
                "K2 of {b} falls with pressure up to 16 Hz, hardly varies round 17.5 Hz and rises above 19 Hz",
                "K2 of {b} rises with frequency",
                "K2 of {a} behaves like that of {b}, at a higher level",
                "TR of {a} is the lower below 18 Hz, that of {b} above",
                "the resonance of {b} lies below that of {a}",
            ],
            start=1,
        )
    ],
)
def test_the_statement_of_a_claim(number, statement):
    assert statement.format(a="the cross-ply (X)", b="the radial-ply at 20 °C") in claimed(
        Lack(Need.BOTH, K1), number=number
    )


@pytest.mark.parametrize(
    ("holds", "verdict"),
    [
        (Holds.TRUE, "holds here"),
        (Holds.TRUE_UNSURE, "holds here, though not beyond the uncertainty"),
        (Holds.FALSE, "does not hold here"),
    ],
)
def test_whether_a_claim_holds(holds, verdict):
    assert f"({stated(1)}) {verdict}: " in claimed(Above(AXES, effects(0.2)), holds)


def test_the_beginning_of_a_claim():
    assert claimed(Above(AXES, effects(0.2)), number=7).startswith(f"Claim 7 of the paper ({stated(7)}) ")


@pytest.mark.parametrize(
    ("lack", "needs"),
    [
        (Lack(Need.BOTH, K1), "K1 of both tyres at a condition in common"),
        (Lack(Need.CURVES), "load-deflection curves of both tyres at a pressure in common"),
        (Lack(Need.THREE_PRESSURES, C, "cross-ply"), "C of the cross-ply (X) at three pressures or more"),
        (Lack(Need.THREE_FREQUENCIES, C, "radial-ply"), "C of the radial-ply at 20 °C at three frequencies or more"),
        (Lack(Need.OPTIMUM, C), "C at three pressures or more, from below 1.56 bar to above 1.80 bar"),
        (Lack(Need.LOADS, C), "C of both tyres at two loads and at two pressures or more"),
        (
            Lack(Need.CORNERS, C),
            "C of both tyres under the lowest and the highest load at the lowest and highest pressure",
        ),
        (Lack(Need.BANDS, K2), "K2 at frequencies up to 16 Hz, between 16.5 and 18.5 Hz, and above 19 Hz"),
        (Lack(Need.SIDES), "TR of both tyres at frequencies below 16.8 Hz and above 19.2 Hz in common"),
        (Lack(Need.PEAKS), "TR of both tyres at three frequencies or more at a condition in common"),
    ],
)
def test_what_a_claim_lacks(lack, needs):
    assert claimed(lack, Holds.NOT_EXAMINED).endswith(f" {needs}.")


def test_a_claim_that_cannot_be_examined():
    assert f"({stated(1)}) cannot be examined here: it needs K1 " in claimed(Lack(Need.BOTH, K1), Holds.NOT_EXAMINED)


EFFECT = Effect(0.1, 0.01)
ABOVE = Above(AXES, effects(0.2, 0.3, -0.1))
RISING = trend((0.2, -0.1))
TURNING = Turning((1e5, 2.5e5), (TurningAt(1000.0, ((Effect(-0.1, 0.01),), (EFFECT,), (EFFECT,)), 0.1),))


def figures(found):
    """The numbers that decide a claim, in words."""
    return claimed(found).partition(": ")[2].removesuffix(".")


@pytest.mark.parametrize(
    ("found", "text"),
    [
        (
            ABOVE,
            (
                "the difference is -10 to 30 % at 3 combinations of pressure and load in common, and the other way "
                "round at 1 of them, such as 2.00 bar, 1000 N"
            ),
        ),
        (
            Nonlinear((0.04, 0.05), (0.01, 0.01)),
            (
                "the curve departs from a straight line by 4.0 to 5.0 % of the load span for the cross-ply (X) and by "
                "1.0 % for the radial-ply at 20 °C, 4.00 to 5.00 times as much, where more than 3 times is asked for"
            ),
        ),
        (RISING, "from 1.00 to 2.50 bar it changes by -10 to 20 % at 2 frequencies and falls at 1 of them"),
        (
            (OptimumAt(1000.0, 1.7e5, {1e5: 0.2, 2.4e5: 0.1}),),
            (
                "averaged over frequency, at 1000 N it is largest at 1.70 bar and 20 % below it at 1.00 bar and 10 % "
                "below it at 2.40 bar"
            ),
        ),
        (
            (ApartAt("cross-ply", (1000.0, 2000.0), (1e5, 2.4e5), Effect(0.01, 0.01), EFFECT),),
            (
                "C of the cross-ply (X) at 1000 N exceeds that at 2000 N by 10 % at 2.40 bar (U 2.0 "
                "%) and by 1.0 % at 1.00 bar"
            ),
        ),
        (
            TURNING,
            (
                "from 1.00 to 2.50 bar, at 1000 N it changes by -10 % up to 16 Hz, by 10 % between 16.5 and 18.5 Hz, "
                "and by 10 % above 19 Hz"
            ),
        ),
        (
            Isolation((1e5, 1.7e5), (EFFECT,), (EFFECT,)),
            (
                "at 1.00 bar and 1.70 bar, TR of the radial-ply at 20 °C is 10 % higher than that of the cross-ply (X) "
                "below 16.8 Hz, and that of the cross-ply (X) 10 % higher above 19.2 Hz"
            ),
        ),
        (
            Order((20.0,), (16.0,), (4.0,)),
            (
                "the largest measured TR of the radial-ply at 20 °C stands at 16.0 Hz and that of the cross-ply (X) at "
                "20.0 Hz, 4.0 Hz higher, at 1 condition in common"
            ),
        ),
    ],
)
def test_the_numbers_that_decide_a_claim(found, text):
    assert figures(found) == text


@pytest.mark.parametrize(("turns", "verb"), [(True, "turns"), (False, "does not turn")])
def test_the_numbers_of_a_claim_of_three_parts(turns, verb):
    assert figures(Likewise(turns, RISING, ABOVE)) == (
        f"its change with pressure {verb} from fall to rise between 16 and 19 Hz; with frequency, {figures(RISING)}; "
        f"against the radial-ply at 20 °C, {figures(ABOVE)}"
    )


def test_tyres_without_a_common_state():
    assert said(NoCommonState(), Holds.NOT_EXAMINED, ("X", "Y"), None) == (
        "The claims of the paper cannot be examined here: X and Y were not tested at a temperature in common, with the "
        "same values of further conditions."
    )


@pytest.mark.parametrize(
    ("holds", "text"),
    [
        ([Holds.TRUE] * 12, "All twelve claims of the 1982 paper hold here."),
        (
            [Holds.TRUE_UNSURE, *[Holds.TRUE] * 9, Holds.FALSE, Holds.NOT_EXAMINED],
            (
                "Of the twelve claims of the 1982 paper 10 hold here (claim 1 not beyond the uncertainty), 11 does "
                "not; 12 cannot be examined."
            ),
        ),
        ([], ""),
    ],
)
def test_the_summary_of_the_claims(holds, text):
    details = (Claim(i, ("X", "Y"), ("", ""), Above(AXES, effects(0.2))) for i in range(1, 13))
    found = [Finding(Topic.CLAIMS, K1, ("X", "Y"), one, detail) for one, detail in zip(holds, details, strict=False)]
    assert summary(found) == text
