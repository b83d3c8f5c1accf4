"""The finding in words, on tables made for each sentence: what is there is said, and nothing else."""

import re

import numpy as np
import polars as pl
import pytest
from tests.findings.designed import LOADS, Tyre, frame, rig_curve
from tests.findings.designed import Tables as Designed

from fourpole.core.checks import Code
from fourpole.findings import findings as found_in
from fourpole.report.words import Sentence, sentences
from fourpole.report.words import headline as headline_of
from fourpole.study.results import Results
from fourpole.study.tables import DYNAMIC_COLUMNS, STATIC_COLUMNS


def findings(results):
    return sentences(found_in(results))


def headline(results):
    return headline_of(found_in(results))


TOPICS = [
    "trust",
    "static stiffness",
    "nonlinearity",
    "dynamic stiffness",
    "damping",
    "loss",
    "resonance",
    "transmissibility",
    "claims",
]
#: Words of which each sentence that claims something has one.
CLAIMING = re.compile(
    r"\b(rises|falls|is higher|is lower|is the|is dynamically|has the|has its|lies below|cross once)\b"
)


class Tables(Designed):
    """Designed tables, and what is said of them."""

    def texts(self, topic: str = "") -> list[str]:
        return [found.text for found in findings(self.results()) if topic in ("", found.topic)]

    def only(self, topic: str, *words: str) -> str:
        """The one sentence on a topic that holds these words."""
        (text,) = (text for text in self.texts(topic) if all(word in text for word in words))
        return text


def test_a_sentence_is_plain_and_belongs_to_a_topic():
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(k1=120e3, tr=rig_curve(17.0))}
    found = findings(Tables(tyres).results())
    assert {type(each) for each in found} == {Sentence}
    order = [TOPICS.index(each.topic) for each in found]
    assert order == sorted(order)
    for each in found:
        assert each.text.endswith(".")
        assert not re.search(r"\bnan\b", each.text)
        assert not re.search(r"\de[+-]?\d|None|[][]", each.text)


def test_the_stiffer_tyre_is_named_with_the_difference_and_where():
    tyres = {"A": Tyre(), "B": Tyre(k1=lambda p, load: 120e3 if p < 240e3 else 150e3)}
    text = Tables(tyres).only("static stiffness", "stiffer")
    assert text.startswith("B is the stiffer: its K1 is above that of A at each of the 8 combinations of pressure ")
    assert "by 27 % on average, from 20 % (1.00 bar, 1000 N) to 50 % (2.50 bar, 2000 N)" in text


def test_where_the_tyres_do_not_differ_is_named():
    tyres = {"A": Tyre(), "B": Tyre(k1=lambda p, load: 100.5e3 if p < 140e3 else 130e3)}
    text = Tables(tyres).only("static stiffness", "stiffer")
    assert (
        "no difference beyond the uncertainty at 2 of 8 conditions in common: (1.00 bar, 1000 N) and (1.00 bar" in text
    )


def test_neither_is_stiffer_where_it_depends():
    tyres = {"A": Tyre(), "B": Tyre(k1=lambda p, load: {100e3: 80e3, 150e3: 100e3}.get(p, 130e3))}
    text = Tables(tyres, loads=(1000.0,)).only("static stiffness", "has the higher")
    assert text == (
        "B has the higher K1, by up to 30 % at 2 of 4 conditions in common: (2.00 bar, 1000 N) and (2.50 bar, 1000 N); "
        "A has the higher K1, by 20 % at 1 of 4 conditions in common: (1.00 bar, 1000 N); "
        "there is no difference beyond the uncertainty at 1 of 4 conditions in common: (1.50 bar, 1000 N)."
    )


def test_a_difference_within_the_uncertainty_is_none():
    text = Tables({"A": Tyre(), "B": Tyre(k1=102e3)}).only("static stiffness", "A and B")
    assert "shows no difference beyond the uncertainty" in text
    assert "that of B is 2.0 % higher on average, no more than twice the standard uncertainty of 1.4 %" in text


def test_tyres_without_a_common_condition_are_not_compared():
    results = Tables({"A": Tyre(), "B": Tyre(k1=200e3)}).results()
    apart = [
        table.filter((pl.col("tyre") == "A") == (pl.col("pressure [Pa]") < 180e3))
        for table in (results.static, results.dynamic)
    ]
    found = findings(Results(*apart, results.previews))
    assert not [each.text for each in found if "A" in each.text and "B" in each.text.replace("Be", "")]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda x: 1 + 0.2 * x,
            r"rises with pressure from 1\.00 to 2\.50 bar, by 18 % on average over 10 combinations",
        ),
        (
            lambda x: 1 - 0.2 * x,
            r"falls with pressure from 1\.00 to 2\.50 bar, by 22 % on average over 10 combinations",
        ),
        (lambda x: 1.0, r"does not vary measurably with pressure: from 1\.00 to 2\.50 bar it changes by \+?0\.0 %"),
        (
            lambda x: 1 - (x - 2 / 3) ** 2,
            r"has its maximum against pressure at 2\.00 bar .* 44 % below it at 1\.00 bar and",
        ),
        (
            lambda x: 1 + (x - 1 / 3) ** 2,
            r"has its minimum against pressure at 1\.50 bar .* 44 % above it at 2\.50 bar",
        ),
    ],
)
def test_a_trend_is_told_with_its_size(change, said):
    tyre = Tyre(c=lambda p, load, f: 900.0 * change((p - 100e3) / 150e3))
    (text,) = (t for t in Tables({"A": tyre}).texts("damping") if re.search(said, t))
    assert text.startswith("C of A ")


def test_a_trend_that_turns_with_frequency_is_told_by_frequency():
    tyre = Tyre(k2=lambda p, load, f: 80e3 * (1 + 0.04 * (f - 17.0) * (p - 175e3) / 150e3))
    text = Tables({"A": tyre}).only("dynamic stiffness", "zero", "between 1.00")
    assert text == (
        "K2 of A, between 1.00 and 2.50 bar, falls with pressure at 10 to 16 Hz, by up to 28 % at 10 Hz and rises with "
        "pressure at 19 to 22 Hz, by up to 20 % at 22 Hz; the change with pressure crosses zero at about 17 Hz."
    )


def test_a_trend_at_some_frequencies_only_is_told_so():
    tyre = Tyre(k2=lambda p, load, f: 80e3 * (1 + (0.3 if f > 18.0 else 0.0) * (p - 175e3) / 150e3))
    text = Tables({"A": tyre}, noise=0.004).only("dynamic stiffness", "rises with pressure")
    assert re.search(r"at 10 to 16 Hz", text), text
    assert re.search(r"rises with pressure (at|from)", text), text


def test_two_values_are_a_difference_and_no_trend():
    tyre = Tyre(k1=lambda p, load: 90e3 + 20.0 * load)
    text = Tables({"A": tyre}).only("static stiffness", "2000 N than")
    assert text == "K1 of A is higher at 2000 N than at 1000 N, by 18 % on average over 4 pressures."
    texts = " ".join(Tables({"A": tyre}, pressures=(100e3, 200e3), frequencies=(10.0, 20.0)).texts())
    assert not re.search("rises|falls|vary", texts)


def test_what_was_not_varied_is_not_spoken_of():
    tyre = Tyre(tr=rig_curve(15.0))
    assert "pressure" not in " ".join(Tables({"A": tyre}, pressures=(None,)).texts())
    texts = " ".join(Tables({"A": tyre}, pressures=(200e3,), loads=(1000.0,)).texts())
    assert not re.search(r"with (pressure|load)|claim|A and|common", texts)
    assert "C of A does not vary measurably with frequency" in texts


def test_without_k1_there_is_no_k2_and_without_v2_no_transmissibility():
    texts = Tables({"A": Tyre(k1=None, loss=None)}).texts()
    assert texts == ["All 44 tests were used without a warning."]
    assert not Tables({"A": Tyre()}).texts("transmissibility")
    assert not Tables({"A": Tyre()}).texts("resonance")


def kind(text: str) -> str:
    """The sentence without its tyre, figures and verdict: what it is about."""
    about = re.search("K1|K2|C of|its C|higher C|loss factor|TR", text)[0][:2]
    return f"{about} {re.search('pressure(?! and)(?!,)|with load|than at|measurably|frequency(?! in)|common', text)[0]}"


@pytest.mark.statistical
def test_noise_is_not_taken_for_a_finding():
    """Of 26 sentences on nothing but noise, each is right in 95 % of the cases at least, all in about 90 %."""
    wrong: list[list[str]] = []
    for seed in range(100):
        texts = Tables({"A": Tyre(), "B": Tyre()}, noise=0.01, seed=seed, loads=LOADS).texts()
        wrong.append([text for text in texts if CLAIMING.search(text)])
    assert sum(map(bool, wrong)) <= 10
    kinds = [kind(text) for texts in wrong for text in texts]
    assert max(map(kinds.count, kinds), default=0) <= 5


def test_scatter_beyond_the_stated_uncertainty_is_seen():
    """Noise far above u on lines of one tyre: the scatter says so."""
    wrong = 0
    for seed in range(100):
        tables = Tables({"A": Tyre()}, loads=(1000.0,), noise=0.03, u=0.001, seed=seed)
        wrong += any(CLAIMING.search(text) for text in tables.texts())
    assert wrong <= 15  # nine sentences, of which each is wrong in 4.6 % of the cases at most


def test_a_trend_well_above_the_noise_is_found():
    tyre = Tyre(c=lambda p, load, f: 900.0 * (1 + 0.15 * (p - 100e3) / 150e3))
    for seed in range(20):
        assert Tables({"A": tyre}, noise=0.01, seed=seed).only("damping", "rises with pressure")


def test_a_resonance_is_found_between_the_tested_frequencies():
    frequencies = (12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0)
    text = Tables({"A": Tyre(tr=rig_curve(15.3))}, pressures=(150e3,), loads=(1000.0,), frequencies=frequencies).only(
        "resonance", "resonates"
    )
    at = float(re.search(r"at about ([\d.]+) Hz \(1\.50 bar\); the largest measured TR is 3\.\d+", text)[1])
    assert at == pytest.approx(15.3, abs=0.05)


def test_a_coarse_grid_only_brackets_the_resonance():
    curve = rig_curve(15.6, 0.05)
    text = Tables({"A": Tyre(tr=curve)}, loads=(1000.0,), frequencies=(10.0, 13.0, 16.0, 19.0)).only(
        "resonance", "between"
    )
    assert re.search(r"between the tested frequencies 1[23]\.\d and 1[89]\.\d Hz \(1\.00 bar\)", text)


def test_a_resonance_at_the_end_of_the_range_is_no_resonance_found():
    text = Tables({"A": Tyre(tr=rig_curve(30.0))}, loads=(1000.0,)).only("resonance")
    assert text.startswith(
        "The largest TR of A stands at the highest tested frequency, beyond which the resonance may lie:"
    )


def test_resonances_of_two_tyres_and_the_crossing_of_their_curves():
    frequencies = tuple(np.arange(11.0, 23.0))
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(tr=rig_curve(18.0))}
    tables = Tables(tyres, frequencies=frequencies)
    lower = tables.only("resonance", "lies below")
    assert lower.startswith("The resonance of A lies below that of B at each of 8 conditions in common, by ")
    f = np.linspace(12.0, 22.0, 100001)
    gap = rig_curve(18.0)(0, 0, f) - rig_curve(15.0)(0, 0, f)
    true = f[np.flatnonzero(np.diff(np.sign(gap)))[0]]
    text = tables.only("transmissibility", "cross once")
    assert "below it B has the lower TR, above it A" in text
    assert float(re.search(r"at ([\d.]+) Hz on average", text)[1]) == pytest.approx(true, abs=0.1)


def test_equal_curves_do_not_cross_and_resonances_are_not_distinguished():
    frequencies = tuple(np.arange(11.0, 23.0))
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(tr=rig_curve(15.02))}
    tables = Tables(tyres, frequencies=frequencies, u=0.02)
    assert "do not cross beyond their uncertainty" in tables.only("transmissibility", "curves")
    assert "cannot be distinguished at each of 8 conditions" in tables.only("resonance", "distinguished")


def test_a_crossing_between_distant_frequencies_is_only_bracketed():
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(tr=rig_curve(18.0))}
    text = Tables(tyres, frequencies=(10.0, 14.0, 20.0, 24.0)).only("transmissibility", "cross once")
    assert re.search(r"between the tested frequencies 1[34]\.\d and 20\.\d Hz", text)


def test_without_k1_of_one_tyre_both_are_compared_by_k_star():
    results = Tables({"A": Tyre(), "B": Tyre(k1=None)}).results()
    known = pl.when(pl.col("tyre") == "A").then(150e3).otherwise(190e3)
    dynamic = results.dynamic.with_columns(known.alias("Re K* [N/m]"), pl.lit(1e3).alias("u(Re K*) [N/m]"))
    texts = [found.text for found in findings(Results(results.static, dynamic, results.previews))]
    assert any(
        t.startswith("B is dynamically the stiffer: its Re K* is above that of A at each of the 40") for t in texts
    )
    assert not any("K2 of B" in text or "K1 of B" in text for text in texts)


def test_added_mass_makes_a_curve_of_its_own():
    bare, loaded = (
        Tables({"A": Tyre(tr=rig_curve(f))}, loads=(1000.0,), more={"added mass [kg]": mass}).results()
        for f, mass in ((17.0, 0.0), (14.0, 10.0))
    )
    both = Results(bare.static, pl.concat([bare.dynamic, loaded.dynamic]), bare.previews)
    texts = " ".join(found.text for found in findings(both) if found.topic == "resonance")
    assert "A at 1000 N resonates" in texts
    assert "A (10 kg added) at 1000 N resonates" in texts


def test_tr_beyond_the_prediction_is_named():
    results = Tables({"A": Tyre(tr=rig_curve(15.0))}).results()
    bad = pl.when(pl.col("test").is_in(["D3", "D12"])).then(1.2).otherwise(1.0)
    dynamic = results.dynamic.with_columns(pl.col("TR measured [1]") * bad)
    (found,) = (f for f in findings(Results(results.static, dynamic, results.previews)) if "predicted" in f.text)
    assert "by 20 % at most" in found.text
    assert found.text.endswith("which is beyond the uncertainty in D3 and D12.")
    assert found.tests == ("D3", "D12")


def test_tests_not_to_trust_are_grouped_by_reason():
    clipped = ("rejected", "F1 is clipped: 3.2 % of its samples stand at the end of its range; set a larger range")
    verdicts = {f"D{i}": clipped for i in range(1, 13)} | {
        "D20": ("warning", "harmonics of the displacement at the contact are 30 % of the fundamental: look at the cam"),
        "D30": ("rejected", "something nobody foresaw; do something"),
        "S2": ("warning", "the gap of the branches; repeat"),
    }
    results = Tables({"A": Tyre()}, verdicts=verdicts).results()
    codes = [(test, Code.CLIPPING, "rejected") for test, said in verdicts.items() if said is clipped]
    codes += [("D20", Code.DISTORTION, "warning"), ("D30", Code.RECORDING, "rejected"), ("D1", Code.MAINS, "warning")]
    rows = [(test, code.text, 1.0, verdict, "") for test, code, verdict in codes]
    checks = pl.DataFrame(rows, ["test", "code", "statistic", "verdict", "remedy"], orient="row")
    told = findings(Results(tables=results.tables, checks=checks))
    assert [found.text for found in told if found.topic == "trust"] == [
        "Of 44 tests 31 could be used, 2 of them with a warning; 13 were rejected.",
        "Do not trust D1, D2, D3, D4, D5, D6, D7, D8, D9, D10 and 2 more (12 tests): a channel is clipped.",
        "Do not trust D30: something nobody foresaw.",
        "Use with care S2: the gap of the branches.",
        "Use with care D20: the motion at the contact is no clean sine.",
    ]
    (found,) = (f for f in told if "clipped" in f.text)
    assert len(found.tests) == 12


def test_without_checks_the_reason_is_the_remark():
    """Results of a version that wrote no checks.csv."""
    tables = Tables({"A": Tyre()}, verdicts={"D3": ("rejected", "F1 is clipped: 3 % of it; set a larger range")})
    assert "Do not trust D3: F1 is clipped: 3 % of it." in tables.texts("trust")


def test_where_all_was_rejected_only_that_is_said():
    rejected = {f"{kind}{i}": ("rejected", "F1 is clipped: x") for kind in "SD" for i in range(1, 50)}
    tables = Tables({"A": Tyre(construction="cross-ply"), "B": Tyre(construction="radial-ply")}, verdicts=rejected)
    tables.pressures = tables.pressures[:2]
    texts = tables.texts()
    assert texts[0] == "None of the 44 tests could be used: all were rejected."
    assert len(texts) == 2
    assert headline(tables.results()) == texts[:1]


def test_an_empty_campaign_is_said_to_be_empty():
    empty = Results(frame([], STATIC_COLUMNS), frame([], DYNAMIC_COLUMNS), pl.DataFrame())
    assert headline(empty) == [found.text for found in findings(empty)] == ["The campaign has no tests."]


@pytest.mark.parametrize("kind", ["one test", "static only", "dynamic only"])
def test_little_is_enough(kind):
    results = Tables({"A": Tyre(tr=rig_curve(15.0), nonlinearity=0.02)}).results()
    none = {"one test": (0, 1), "static only": (99, 0), "dynamic only": (0, 999)}[kind]
    cut = Results(results.static.head(none[0]), results.dynamic.head(none[1]), results.previews)
    texts = [found.text for found in findings(cut)]
    if kind == "one test":
        assert texts[0] == "The only test was used without a warning."
        assert not re.search("rises|falls|resonates|common", " ".join(texts))
        assert "K2 of A is 80.0 kN/m at 1.00 bar, 1000 N, 10 Hz, with a standard uncertainty of 1.0 %." in texts
    assert all(text.endswith(".") for text in texts)


def test_the_order_of_the_rows_does_not_matter():
    rng = np.random.default_rng(3)
    tyres = {
        "tyre 10": Tyre(tr=rig_curve(15.0), construction="Radial-ply steel", nonlinearity=0.01),
        "tyre 9": Tyre(k1=140e3, tr=rig_curve(17.0), construction="cross-ply", nonlinearity=0.05),
    }
    verdicts = {"D3": ("rejected", "x is clipped"), "D12": ("warning", "noise")}
    results = Tables(tyres, noise=0.01, verdicts=verdicts).results()
    first = findings(results)
    assert [f.text for f in first if f.topic == "static stiffness"][1].startswith("K1 of tyre 9")
    for _ in range(3):
        mixed = [t[rng.permutation(t.height).tolist()] for t in (results.static, results.dynamic)]
        again = Results(*mixed, results.previews)
        assert findings(again) == first
        assert headline(again) == headline(results)


@pytest.mark.parametrize(
    "name",
    ["<script>alert(1)</script>", "{tyre}", "%s %d", "a, b and c", "x" * 300, "7" * 6000, "Reifen ß №5", "a\nb", ""],
)
def test_a_name_stands_as_it_is(name):
    tyres = {name: Tyre(tr=rig_curve(15.0)), "other": Tyre(k1=150e3, tr=rig_curve(17.0))}
    results = Tables(tyres).results()
    texts = [found.text for found in findings(results)]
    assert sum(name in text for text in texts) >= 8
    assert headline(results)


def test_many_tyres_are_not_compared_each_with_each():
    tyres = {f"T{i}": Tyre(k1=100e3 + 5e3 * i, tr=rig_curve(14.0 + 0.5 * i)) for i in range(1, 9)}
    texts = Tables(tyres).texts()
    assert sum("stiffer" in text and "K1" in text for text in texts) == 1
    assert any(text.startswith("T8 is the stiffer: its K1 is above that of T1") for text in texts)
    assert len(texts) < 20 * len(tyres)


def test_the_headline_is_short():
    tyres = {"A": Tyre(tr=rig_curve(15.0)), "B": Tyre(k1=130e3, tr=rig_curve(17.0))}
    lines = headline(Tables(tyres).results())
    assert 5 <= len(lines) <= 8
    assert lines[0] == "All 88 tests were used without a warning."


def paper_pair(**changed):
    cross = {"k1": 150e3, "construction": "Cross-Ply, 4 plies", "tr": rig_curve(20.0), "nonlinearity": 0.04}
    return {
        "X": Tyre(**(cross | changed)),
        "Y": Tyre(construction="radial ply", tr=rig_curve(16.0), nonlinearity=0.008),
    }


def test_claims_are_told_of_the_two_tyres_of_the_paper_only():
    claims = Tables(paper_pair()).texts("claims")
    assert [text.split(" of the paper")[0] for text in claims] == [f"Claim {i}" for i in range(1, 13)]
    assert claims[0].startswith(
        "Claim 1 of the paper (K1 of the cross-ply (X) is above that of the radial-ply (Y)) holds"
    )
    for other in ("", "radial"):
        tyres = paper_pair()
        tyres["X"].construction = other
        assert not Tables(tyres).texts("claims")
    assert not Tables({**paper_pair(), "Z": Tyre()}).texts("claims")
    assert not Tables({"X": paper_pair()["X"]}).texts("claims")


def test_a_claim_that_is_false_here_is_called_false():
    claims = Tables(paper_pair(k1=80e3, nonlinearity=0.01, tr=rig_curve(13.0))).texts("claims")
    for number in (1, 2, 11, 12):
        assert ") does not hold here: " in claims[number - 1], claims[number - 1]
    assert "-20 %" in claims[0]


def test_a_claim_lacking_its_tests_cannot_be_told():
    claims = Tables(paper_pair(), pressures=(150e3,), loads=(1000.0,), frequencies=(10.0, 12.0)).texts("claims")
    told = {i + 1 for i, text in enumerate(claims) if "cannot be examined here: it needs " not in text}
    assert told == {1, 2, 7}


def test_a_difference_within_the_uncertainty_holds_with_that_word():
    (text,) = (t for t in Tables(paper_pair(k1=101e3)).texts("claims") if t.startswith("Claim 1 "))
    assert ") holds here, though not beyond the uncertainty: " in text


def test_one_tyre_at_two_temperatures_is_compared_and_not_averaged():
    made = Tables({"A": Tyre(k1=146e3), "B": Tyre(k1=106e3)}).results()

    def warmed(table):
        warm = pl.when(pl.col("tyre") == "A").then(20.0).otherwise(60.0).alias("temperature [degC]")
        return table.with_columns(warm).with_columns(pl.lit("A").alias("tyre"))

    found = findings(Results(warmed(made.static), warmed(made.dynamic), pl.DataFrame()))
    texts = [each.text for each in found if each.topic == "static stiffness"]
    assert texts[0].startswith("A at 20 °C is the stiffer: its K1 is above that of A at 60 °C")
    assert any("146 kN/m" in text for text in texts)
    assert any("106 kN/m" in text for text in texts)
    assert not any("126" in text for text in texts)
