"""report.html: what stands on it, that nothing from files can hurt it, and what it does in a real browser."""

from __future__ import annotations

import base64
import cmath
import json
import math
import re
import xml.etree.ElementTree as ET
from contextlib import ExitStack
from dataclasses import dataclass, replace
from html.parser import HTMLParser

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.plot.conftest import results_of
from tests.plot.modelled import study_with_models
from tests.plot.rig_found import MISFIT, VALUES, budget_table, residual_table, rig_table, with_rig_found
from tests.report.browser import launched, renewed, watched

from fourpole.core.condition import PRESSURE, axis_of
from fourpole.core.digits import number, with_std
from fourpole.report.cards import ALPHABET, embedded, make_cards, packed
from fourpole.report.digits import spread
from fourpole.report.page import ReportFigure, _versions, render_report, write_report
from fourpole.report.words.limits import limits
from fourpole.report.words.rig import rigs_in_words
from fourpole.study.study import Study
from fourpole.study.tables import DYNAMIC, STATIC

# A tyre of closed formulas: K* in the tables, F1 and the deflection in the signals.
STIFFNESS = 190e3 + 60e3j
HOSTILE = "<script>alert(1)</script>\"'&"
REMARK = "</script><script>alert(2)</script><img src=x onerror=alert(3)> \u2028 <!-- {{ 7*7 }}"
LONG = "recordings/" + "x" * 289


@dataclass(frozen=True)
class Sentence:
    topic: str
    text: str
    tests: tuple[str, ...] = ()


def dynamic_row(at, **cells):
    frequency = 10.0 + at % 15
    v1, v2 = 0.1, 0.16 * cmath.exp(-0.3j)
    f1 = STIFFNESS * (v1 - v2) / (2j * math.pi * frequency)
    return {
        **{name: "" if kind == pl.String else None for name, kind in DYNAMIC.columns.items()},
        "test": f"D{at}",
        "tyre": ("cross", "radial")[at % 2],
        "construction": "ply",
        "pressure [Pa]": 1.7e5,
        "preload [N]": 1000.0,
        "added mass [kg]": 0.0,
        "frequency [Hz]": frequency,
        "F1 [N]": abs(f1),
        "V1 [m/s]": v1,
        "V2 [m/s]": abs(v2),
        "phase F1-V1 [rad]": cmath.phase(f1 / v1),
        "phase V2-V1 [rad]": cmath.phase(v2),
        "R [m/(N s)]": 1.3059139992e-4,
        "I [m/(N s)]": -1.01295678e-3,
        "u(R) [m/(N s)]": 2.8e-7,
        "u(I) [m/(N s)]": 3.1e-7,
        "corr(R,I) [1]": -0.0287,
        "Re K* [N/m]": STIFFNESS.real + at,
        "Im K* [N/m]": STIFFNESS.imag,
        "u(Re K*) [N/m]": 619.0,
        "u(Im K*) [N/m]": 568.0,
        "corr(Re,Im K*) [1]": 0.3037,
        "loss factor [1]": 0.3116630774,
        "u(loss factor) [1]": 0.0031413,
        "K1 [N/m]": 143343.2447,
        "u(K1) [N/m]": 3781.1,
        "K2 [N/m]": 128479.514,
        "C [N s/m]": 1105.36,
        "u(K2) [N/m]": 9442.2,
        "u(C) [N s/m]": 66.5,
        "corr(K2,C) [1]": -0.949,
        "TR measured [1]": 1.3159406,
        "TR predicted [1]": 1.3170524,
        "u(TR) [1]": 0.0013108,
        "route": "mobility",
        "verdict": "ok",
        **cells,
    }


def static_row(test, preload, tyre="cross", **cells):
    return {
        "test": test,
        "tyre": tyre,
        "construction": "ply",
        "pressure [Pa]": 1.7e5,
        "preload [N]": preload,
        "K1 [N/m]": 150e3,
        "u(K1) [N/m]": 4e3,
        "secant [N/m]": 130e3,
        "hysteresis loss [J]": 3.65,
        "nonlinearity [1]": 0.0443,
        "verdict": "ok",
        "remarks": "",
        **cells,
    }


def dynamic_preview(row):
    time_ = np.linspace(-1.5, 1.5, 96) / row["frequency [Hz]"]
    found = {
        "test": row["test"],
        "time [s]": time_.tolist(),
        "residual time [s]": np.repeat(np.arange(60.0), 2).tolist(),
    }
    noise = np.random.default_rng(5)
    turning = np.exp(2j * np.pi * row["frequency [Hz]"] * time_)
    for name, amplitude in (
        ("F1", cmath.rect(row["F1 [N]"], 0.7 + row["phase F1-V1 [rad]"])),
        ("V1", cmath.rect(row["V1 [m/s]"], 0.7)),
        ("V2", cmath.rect(row["V2 [m/s]"], 0.7 + row["phase V2-V1 [rad]"])),
    ):
        fit = (amplitude * turning).real
        found[name] = (fit * (1 + 0.01 * noise.normal(size=fit.size))).tolist()
        found[f"{name} fit"] = fit.tolist()
        found[f"{name} residual"] = (abs(amplitude) * 0.01 * np.tile([-1.0, 1.0], 60)).tolist()
    return found


def static_preview(test):
    x = np.linspace(0.0, 0.02, 80)
    mean = 150e3 * x
    gap = 2e3 * x * (1 - x / 0.02)
    return {
        "test": test,
        "deflection [m]": [*x, *x[::-1]],
        "load [N]": [*(mean + gap), *(mean - gap)[::-1]],
        "mean deflection [m]": x.tolist(),
        "mean load [N]": mean.tolist(),
    }


def frame(rows, columns):
    types = dict(columns)
    types |= {name: pl.String for row in rows for name in row if name not in types}
    return pl.DataFrame({name: [row.get(name) for row in rows] for name in types}, schema=types)


def made(dynamic=(), static=(), *, previews=True, **record):
    """Results in memory, as an analysis leaves them."""
    seen = [] if not previews else [static_preview(test) for test in dict.fromkeys(row["test"] for row in static)]
    seen += [dynamic_preview(row) for row in dynamic if previews]
    lists = dict.fromkeys((name for row in seen for name in row if name != "test"), pl.List(pl.Float32))
    names = ["test", *lists]
    table = pl.DataFrame([[row.get(name) for row in seen] for name in names], schema={"test": pl.String, **lists})
    stated = {
        "rigs": {
            "": {
                "output": "moving",
                "moving_mass": {"value": 15.0, "std": 0.3, "unit": "kg", "assumed": True},
                "preload_stiffness": {"value": 12440.0, "std": 20.0, "unit": "N/m", "assumed": False},
            }
        },
        "channels": {
            "force_in": {"column": "F1", "unit": "kN", "gain": 1.02, "quantity": "force", "std_gain [1]": 0.01},
            "motion_in": {
                "column": "V1",
                "unit": "m/s",
                "quantity": "velocity",
                "std_gain [1]": 0.0,
                "exact": True,
                "low_cut": 0.5,
                "std_low_cut": "10 %",
                "coupling": "ac",
                "mounted": "drive",
                "serial": "S7",
            },
        },
        "specimens": {"cross": {"construction": "ply", "size": "5.60-13"}},
    }
    whole = {
        "title": "Two tyres",
        "settings": {"route": "mobility"},
        "stated": stated,
        "versions": {"fourpole": "0.1.0", "numpy": "2.4.6"},
        "assumptions": ["[rig] moving_mass: no std stated, taken as 2 %"],
        "sha256": {"campaign.toml": "ab" * 32},
        **record,
    }
    return Study(frame(static, STATIC.columns), frame(dynamic, DYNAMIC.columns), table, whole)


def drawing(size=0, inside=""):
    """An SVG of about `size` characters that nothing can shorten."""
    marks = "".join(f'<use x="{at}" y="{at % 97}"/>' for at in range(size // 22))
    start = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 504 216">'
    return f'{start}<path id="a" d="M0 0L9 9"/>{inside}{marks}</svg>'


def figures(count=2, size=0):
    return {f"f{at}": ReportFigure(f"f{at}", f"Stiffness {at}", f"Caption {at}", drawing(size)) for at in range(count)}


def campaign(count=12, *, static=2, **record):
    dynamic = [dynamic_row(at) for at in range(1, count + 1)]
    return made(dynamic, [static_row(f"S{at}", n) for at in range(1, static + 1) for n in (1000.0, 2000.0)], **record)


def varied():
    """Two tyres, a rejected test without results, a warning, blanks."""
    dynamic = [dynamic_row(at) for at in range(1, 11)]
    nothing = dict.fromkeys(list(DYNAMIC.columns)[8:-3])
    dynamic[3] |= {**nothing, "verdict": "rejected", "remarks": "the tyre lifts off"}
    dynamic[6] |= {"K2 [N/m]": None, "u(K2) [N/m]": None, "verdict": "warning", "remarks": "K2 is left blank"}
    results = made([row for row in dynamic if row["frequency [Hz]"]], [static_row("S1", 1000.0)])
    return Study(results.static, frame(dynamic, DYNAMIC.columns), results.previews, results.record)


def hostile():
    rows = [
        dynamic_row(
            1, test=HOSTILE, tyre=HOSTILE, construction=HOSTILE, remarks=REMARK, verdict="warning", rig=HOSTILE
        ),
        dynamic_row(2, test="اختبار-٤٢" * 30, tyre="إطار شعاعي", extra=REMARK),
        dynamic_row(3, test="試験" * 100, tyre="ラジアルタイヤ" * 40, remarks=LONG, verdict="rejected"),
        dynamic_row(4, test=LONG, tyre="a\u202eb", verdict="none that is known"),
    ]
    static = [static_row(f"S{HOSTILE}", 1000.0, tyre=HOSTILE, remarks=REMARK, verdict="rejected")]
    results = made(
        rows,
        static,
        title=f"{HOSTILE} {LONG}",
        settings={HOSTILE: REMARK},
        versions={HOSTILE: REMARK},
        assumptions=[REMARK, LONG],
        sha256={LONG: "0" * 64, HOSTILE: REMARK},
        stated={
            "rigs": {HOSTILE: {"output": REMARK, HOSTILE: {"value": 1.0, "std": 0.1, "unit": HOSTILE}, "x": REMARK}},
            "channels": {HOSTILE: {"column": LONG, "unit": HOSTILE, "range": REMARK, "quantity": REMARK}, "x": 1},
            "specimens": {HOSTILE: {HOSTILE: REMARK}},
            "sample_rate [Hz]": None,
            "limits": [HOSTILE, {"quantity": "storage", "high": 1.9e5}],
            "report": {
                **dict.fromkeys(("laboratory", "address", "number", "logo", "frequency [Hz]"), HOSTILE),
                **dict.fromkeys(("customer", "tested", "method"), LONG),
                "equipment": [HOSTILE, {"name": HOSTILE, "due": LONG}],
            },
        },
        joint={
            HOSTILE: {
                **MISFIT,
                "notes": [REMARK],
                "reason": REMARK,
                "converged": False,
                "candidates": [{"text": REMARK}],
            }
        },
    )
    rig = rig_table({HOSTILE: VALUES["gain V1"], f"gain {HOSTILE}": VALUES["gain V1"]}, HOSTILE)
    return replace(
        results,
        rig=rig.with_columns(
            pl.lit(REMARK).alias("remarks"), pl.lit(HOSTILE).alias("finding"), pl.lit(HOSTILE).alias("unit")
        ),
        residuals=residual_table(results.dynamic.head(1), **{"outlier [1]": 99.0}),
        budget=budget_table(results.dynamic, {HOSTILE: 1.0}),
    )


def hostile_findings():
    return [Sentence(HOSTILE, REMARK, (HOSTILE, LONG, "no such test"))]


def hostile_figures():
    inside = "<script>alert(4)</script><image href='http://example.org/x.png'/>"
    return {"f": ReportFigure(HOSTILE, HOSTILE, REMARK, drawing(inside=inside))}


class Reader(HTMLParser):
    """What a page is made of, and whether its elements are closed in order."""

    VOID = frozenset({"meta", "link", "br", "img", "input"})

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.addresses, self.scripts, self.handlers, self.texts = [], [], [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        named = dict(attrs)
        self.ids += [named["id"]] if "id" in named else []
        self.addresses += [named[name] for name in ("src", "href", "action", "data", "srcset") if name in named]
        self.handlers += [name for name in named if name.startswith("on") or name == "style"]
        if tag == "script":
            self.scripts.append("")
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] == ["script"]:
            self.scripts[-1] += data
        elif self.open[-1:] != ["style"]:
            self.texts.append(data)


def on_page(results, findings=(), drawn=None):
    return " ".join(" ".join(Reader(render_report(results, findings=findings, figures=drawn or {})).texts).split())


def unpacked(curve):
    low, step, text = curve
    level = np.array([64 * ALPHABET.index(a) + ALPHABET.index(b) for a, b in zip(text[::2], text[1::2], strict=True)])
    return np.where(level == 4095, np.nan, low + step * level)


# ---- what stands on it


def test_everything_that_was_found_and_stated_is_there():
    said = on_page(varied(), [Sentence("Damping", "C rises by 9 %.", ("D1", "D2"))], figures())
    for text in (
        "Two tyres",
        "10 used of 11 tests, 1 with a warning, 1 rejected.",
        "C rises by 9 %. D1 , D2",
        "size : 5.60-13",
        "1.7 bar",
        "15.0 0.6 assumed kg",
        "12.44 0.04 kN/m",
        "force in kN gain 1.02 1 % assumed",
        "low-cut 0.500 Hz, u(low-cut) 10 %, coupling ac, mounted on the drive, serial number S7",
        "taken as 2 %",
        "190.0 ± 1.2",
        "1110 ± 130",
        "the tyre lifts off",
        "K2 is left blank",
        "Figure 1: Stiffness 0. Caption 0",
        "mobility",
        "2.4.6",
        "ab" * 32,
    ):
        assert text in said, text


def test_the_rig_and_the_sensors_stand_as_stated_and_as_found():
    results = with_rig_found(campaign(4))
    said = on_page(results)
    (found,) = rigs_in_words(results)
    for text in (
        "The rig and the sensors, as found",
        f"{found.fit} {found.summary}",
        "moving mass m kg 15.00 ±0.20 15.020 ±0.020 0.10 +0.20 0.31 kg found from your data",
        "gain of V1 % 0.0 ±2.0 0.0 ±2.0 1.0 – at no size not determined by your data, taken from your statement",
        *found.unseen,
        found.gain,
        limits(results)[0].text,
    ):
        assert text in said, text
    assert "does not fit" not in said


def test_a_rig_that_does_not_fit_has_a_box_of_its_own():
    results = with_rig_found(campaign(4), **MISFIT)
    said = on_page(results)
    (found,) = rigs_in_words(results)
    assert " ".join(found.misfit) in said
    assert all(text in said for text in found.candidates)
    assert 'class="misfit"' in render_report(results, findings=(), figures={})


def test_outliers_lead_to_their_cards():
    results = with_rig_found(campaign(4))
    rows = residual_table(results.dynamic, **{"outlier [1]": 60.0})
    text = render_report(replace(results, residuals=rows.filter(pl.col("test") == "D2")), findings=(), figures={})
    assert re.search(r'This test does not go with the others.*<a href="#dynamic-2" title="D2">', text)


def test_a_campaign_of_another_route_has_no_such_section():
    text = render_report(campaign(2), findings=(), figures={})
    assert 'id="rig-as-found"' not in text
    assert 'id="limits"' not in text


def test_each_rig_is_told_apart():
    results = campaign(4)
    rigs = pl.when(pl.col("test") == "D1").then(pl.lit("old rig")).otherwise(pl.lit("new rig")).alias("rig")
    said = on_page(with_rig_found(replace(results, dynamic=results.dynamic.with_columns(rigs))))
    assert "Rig old rig 120 tests" in said
    assert "Rig new rig : U of K2 is 15 % (median of 3 tests)." in said


def test_numbers_of_figures_go_on_from_those_they_have():
    named = {
        "a": ReportFigure("a", "Figure 14: TR", "", drawing(), 14),
        "b": ReportFigure("b", "Nyquist", "", drawing()),
    }
    said = on_page(campaign(1), drawn=named)
    assert "Figure 14: TR." in said
    assert "Figure 15: Nyquist." in said


def test_a_table_has_all_digits_to_sort_by():
    text = render_report(campaign(1), findings=(), figures={})
    assert 'data-v="0.00013059139992"' in text
    assert 'data-v="190001.0"' in text


@pytest.mark.parametrize(
    "results",
    [
        made(),
        made([dynamic_row(1)]),
        made([], [static_row("S1", None, **{"K1 [N/m]": None})]),
        made([dynamic_row(1)], [static_row("S1", 1000.0)], previews=False),
        Study(frame([], STATIC.columns), frame([dynamic_row(1)], DYNAMIC.columns), pl.DataFrame(), {}),
        made([dynamic_row(1)], stated=3, versions=None, settings=[], assumptions="no", sha256=1, title=None),
    ],
    ids=["nothing", "one dynamic", "one static", "no previews", "no record", "a strange record"],
)
def test_a_page_is_made_of_whatever_there_is(results):
    assert "The run" in on_page(results)


def test_the_loop_encloses_the_energy_of_the_loss_stiffness():
    (card,), _, _ = make_cards(made([dynamic_row(1)]))
    loop = card.body["loop"]
    assert loop["f"] / loop["d"] == pytest.approx(abs(STIFFNESS), rel=1e-5)
    assert loop["lag"] == pytest.approx(cmath.phase(STIFFNESS), rel=1e-5)
    energy = dict(card.body["facts"])["energy lost per cycle"]
    assert float(energy.removesuffix(" J")) == pytest.approx(math.pi * STIFFNESS.imag * loop["d"] ** 2, rel=1e-3)
    # Samples of the force over the deflection lie on the ellipse: the noise of the signal is 1 %.
    moment = unpacked(card.body["t"])
    force = loop["f"] * np.cos(loop["w"] * moment + loop["p"] + loop["lag"])
    assert unpacked(card.body["signals"][0]["s"]) == pytest.approx(force, abs=0.05 * loop["f"])


def test_without_the_far_side_the_loop_is_at_the_contact():
    (card,), _, _ = make_cards(made([dynamic_row(1, **{"V2 [m/s]": None, "phase V2-V1 [rad]": None})], previews=False))
    assert card.body["loop"]["across"] is False
    assert card.body["loop"]["d"] == pytest.approx(0.1 / (2 * math.pi * 11.0), rel=1e-5)


def test_tangents_touch_the_mean_curve_at_the_preload():
    (card,), keys, _ = make_cards(made([], [static_row("S1", 1000.0), static_row("S1", 2000.0), static_row("S1", 9e3)]))
    assert keys == ["static-1"] * 3
    assert card.body["curve"]["tangents"] == [
        [pytest.approx(1000 / 150e3, rel=1e-5), 1000.0, 150e3],
        [pytest.approx(2000 / 150e3, rel=1e-5), 2000.0, 150e3],
    ]


@given(st.lists(st.floats(-1e6, 1e6, width=32) | st.just(math.nan), min_size=1))
def test_a_packed_curve_comes_back_within_half_a_level(values):
    values = np.array(values)
    seen = values[np.isfinite(values)]
    span = np.ptp(seen) if seen.size else 0.0
    # 4094 levels; the extremes are kept to eight digits.
    np.testing.assert_allclose(unpacked(packed(values)), values, rtol=6e-8, atol=span / 8188 * 1.001 + 1e-7 * span)


@given(st.dictionaries(st.text(), st.text() | st.floats(allow_nan=False, allow_infinity=False)))
def test_embedded_json_comes_back_and_holds_no_markup(value):
    text = embedded(value)
    assert json.loads(text) == value
    assert not set(text) & set("<>&\u2028\u2029")


@pytest.mark.parametrize(
    ("shown", "expected"),
    [
        (number(0.0), "0"),
        (number(-1.5), "−1.500"),
        (number(9999.96), "10000"),
        (number(math.nan), ""),
        (number(2.5e-7, 2), "2.5×10⁻⁷"),
        (with_std(0.0, 0.0), ("0", "")),
        (with_std(99.96, 0.0996), ("99.96", "0.10")),
        (with_std(-0.001, 0.1), ("0.00", "0.10")),
        (with_std(128.0, 150.0), ("130", "150")),
        (with_std(None, 1.0), ("", "")),
        (spread([1.0, 2.0, 2.01, math.nan], PRESSURE, "bar"), "1, 2.005 bar"),
        (spread([20.0, 24.9, 60.0], axis_of("temperature [degC]"), "°C"), "22.45, 60 °C"),
    ],
)
def test_numbers_have_the_digits_that_are_known(shown, expected):
    assert shown == expected


# ---- that nothing can hurt it


def test_whatever_files_hold_stays_text():
    text = render_report(hostile(), findings=hostile_findings(), figures=hostile_figures())
    page = Reader(text)
    assert len(page.scripts) == 2
    assert page.handlers == []
    assert text.count("<script") == text.count("</script") == 2
    data = json.loads(page.scripts[0])
    assert data["dynamic-1"]["remarks"] == [REMARK]
    whole = "".join(page.texts)
    assert whole.count(HOSTILE) > 10
    assert "{{ 7*7 }}" in whole


def test_a_page_asks_for_nothing():
    page = Reader(render_report(hostile(), findings=hostile_findings(), figures=hostile_figures()))
    assert len(set(page.ids)) == len(page.ids)
    assert {address[:1] if address[0] == "#" else address[:5] for address in page.addresses} == {"#", "data:"}
    assert {address[1:] for address in page.addresses if address[0] == "#"} <= set(page.ids)


def test_only_the_script_of_the_page_may_run():
    text = render_report(campaign(1), findings=(), figures={})
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
    assert "default-src &#39;none&#39;" in policy or "default-src 'none'" in policy
    assert "connect-src" not in policy
    assert re.search(r"script-src 'sha256-[A-Za-z0-9+/]{43}='", policy.replace("&#39;", "'"))


def test_a_character_that_no_file_can_hold_is_replaced(tmp_path):
    path = tmp_path / "report.html"
    write_report(campaign(1, title="a\ud800b\x00c\x1bd"), path, findings=(), figures={})
    assert "a\ufffdb\ufffdc\ufffdd" in path.read_text(encoding="utf-8")


def test_a_figure_is_an_image_of_its_own_and_loses_nothing_that_is_seen():
    svg = (
        '<?xml version="1.0"?>\n<!DOCTYPE svg PUBLIC "a" "b">\n<svg xmlns="http://www.w3.org/2000/svg" '
        'viewBox="0 0 504.1 216">\n <metadata>long</metadata>\n <path d="M 1.23456 2 \nL 1e-05 3.999" id="p"/>\n'
        " <text>a  b</text>\n</svg>"
    )
    figure = ReportFigure("k", "t", "c", svg)
    assert figure.size == (504, 216)
    root = ET.fromstring(base64.b64decode(figure.address.partition(",")[2]))
    path, text = root
    assert path.attrib == {"d": "M 1.23456 2 L 1e-05 3.999", "id": "p"}
    assert text.text == "a  b"


@pytest.mark.sampled(4)
def test_two_hundred_tests_with_twenty_figures_stay_light():
    drawn = figures(20, 150_000)
    assert min(len(figure.svg) for figure in drawn.values()) > 145_000
    assert len(render_report(campaign(200), findings=(), figures=drawn).encode()) < 5e6


# ---- in a browser


@pytest.fixture(scope="module")
def browser():
    with launched() as one:
        yield one


@pytest.fixture(scope="module")
def window(browser):
    """A page that all tests use, one after the other."""
    with browser.new_context() as room:
        page = room.new_page()
        page.set_default_timeout(60_000)
        yield page


@pytest.fixture
def visit(browser, window, tmp_path):
    """Open a page of results; what it did is looked at when the test is over."""
    path = tmp_path / "report.html"
    with ExitStack() as left:

        def opened(results, findings=(), drawn=None, *, unfold=True, viewport=None, **context):
            write_report(results, path, findings=findings, figures=figures() if drawn is None else drawn)
            page = left.enter_context(browser.new_context(**context)).new_page() if context else renewed(window)
            if viewport:
                page.set_viewport_size(viewport)
            seen = left.enter_context(watched(page))
            left.callback(lambda: seen.assert_quiet(path))
            page.goto(path.as_uri())
            if unfold:
                page.evaluate("document.querySelectorAll('.part').forEach((part) => { part.open = true; })")
            return page

        yield opened


def column(page, head):
    """Keys of a column of the dynamic table from top to bottom, of the rows in sight."""
    return page.evaluate(
        """head => {
          const table = document.getElementById("table-dynamic");
          const heads = [...table.tHead.rows[0].cells];
          const at = heads.findIndex((cell) => cell.querySelector("span").textContent === head);
          return [...table.tBodies[0].rows].filter((row) => !row.hidden).map((row) => {
            const cell = row.cells[at];
            return cell.dataset.v === undefined ? cell.textContent : Number(cell.dataset.v);
          });
        }""",
        head,
    )


def head(page, name):
    return page.locator("#table-dynamic thead").get_by_role("button", name=name, exact=True)


@pytest.mark.sampled(4)
def test_a_table_sorts_by_its_heads(visit):
    page = visit(varied())
    head(page, "K2").click()
    assert page.locator("#table-dynamic th[aria-sort=ascending]").inner_text().startswith("K2")
    assert column(page, "test")[-2:] == ["D4", "D7"]  # blanks last
    cell = page.locator("#table-dynamic tbody tr").first.locator("td[data-v='143343.2447']")
    cell.hover()
    assert cell.get_attribute("title") == "143343.2447 N/m"
    head(page, "f").focus()
    page.keyboard.press("Enter")
    rising = column(page, "f")
    page.keyboard.press("Enter")
    falling = column(page, "f")
    assert rising[-1] == falling[-1] == ""
    assert rising[:-1] == sorted(rising[:-1]) == falling[:-1][::-1]
    assert page.locator("#table-dynamic th[aria-sort]").count() == 1
    head(page, "test").click()
    assert column(page, "test") == [f"D{at}" for at in range(1, 11)]


def test_the_contents_lead_to_the_rig_and_to_what_limits(visit):
    results = with_rig_found(varied(), **MISFIT)
    page = visit(results, unfold=False)
    for name, place in (("Rig and sensors, as found", "rig-as-found"), ("What limits", "limits")):
        page.get_by_role("navigation").get_by_role("link", name=name).click()
        assert page.url.endswith(f"#{place}")
        assert page.locator(f"#{place} > .part[open] li").first.is_visible()
    box = page.get_by_role("note")
    assert rigs_in_words(results)[0].misfit[0] in box.inner_text()
    assert box.locator("li").count() == 2
    assert page.locator("#rig-as-found tbody th[scope=row]").count() == len(VALUES)


@pytest.mark.sampled(2)
def test_models_are_reached_and_their_parameters_open(visit):
    page = visit(study_with_models())
    page.get_by_role("navigation").get_by_role("link", name="Models").click()
    assert page.url.endswith("#models")
    table = page.get_by_role("region", name="Parameters of cross-ply")
    assert not table.is_visible()
    page.get_by_text("Parameters of zener in 6 conditions").first.click()
    assert table.is_visible()
    assert table.locator("tbody tr").count() == 6
    for width in (1280, 360):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert table.bounding_box()["width"] <= width


def faint_in_either_scheme(page, named):
    """Text without enough contrast, in light and in dark."""
    found = []
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        found += [(scheme, name, ratio) for name, ratio in page.evaluate(CONTRAST, named).items() if ratio < 4.5]
    return found


@pytest.mark.sampled(2)
def test_models_stand_out_in_light_and_dark(visit):
    page = visit(replace(study_with_models(), faults=("map.json is of other results",)))
    page.get_by_text("Parameters of zener in 6 conditions").first.click()
    named = ["#models code", "#models .f.found", "#models caption", "#models td small"]
    named += ["#models .misfit p", "#models summary", "#models .note", "#models h4"]
    assert faint_in_either_scheme(page, named) == []


@pytest.mark.sampled(2)
def test_ranges_of_page_one_need_no_bar_at_1100_pixels(visit):
    page = visit(results_of(), viewport={"width": 1100, "height": 800})
    table = page.get_by_role("region", name="Results", exact=True)
    assert "–" in table.locator("tbody tr").first.inner_text()
    assert table.evaluate("box => box.scrollWidth <= box.clientWidth")


@pytest.mark.sampled(2)
def test_the_table_of_the_rig_scrolls_by_itself_on_a_narrow_screen(visit):
    page = visit(with_rig_found(varied(), **MISFIT))
    for width in (1280, 360):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.get_by_role("region", name="Shared values").bounding_box()["width"] <= width


@pytest.mark.sampled(2)
def test_an_outlier_opens_its_card(visit):
    results = with_rig_found(varied())
    rows = residual_table(results.dynamic.filter(pl.col("test") == "D2"), **{"outlier [1]": 60.0})
    page = visit(replace(results, residuals=rows))
    page.locator("#rig-as-found").get_by_role("link", name="D2").click()
    page.locator("details#dynamic-2[open]").wait_for(state="attached")


@pytest.mark.sampled(2)
def test_filters_meet_tables_and_cards(visit):
    page = visit(varied())
    shown = page.locator("#shown")
    assert shown.inner_text() == "11 of 11 tests"
    page.locator("#verdict").select_option("rejected")
    assert column(page, "test") == ["D4"]
    assert page.locator(".cards details:visible").count() == 1
    page.get_by_role("button", name="Show all").click()
    page.locator("#tyre").select_option("radial")
    assert set(column(page, "specimen")) == {"radial"}
    page.locator("#tyre").select_option("all")
    page.get_by_label("Find").fill("LIFTS off")
    assert column(page, "test") == ["D4"]
    assert shown.inner_text() == "1 of 11 tests"
    page.get_by_label("Find").fill("no such thing")
    assert column(page, "test") == []


def test_a_card_opens_from_the_table_and_draws(visit):
    page = visit(campaign())
    assert page.locator(".card").count() == 0
    page.locator("#table-dynamic").get_by_role("link", name="D2", exact=True).click()
    card = page.locator("#dynamic-2")
    card.locator(".card").wait_for()
    assert page.locator(".card").count() == 1
    assert card.locator("svg").count() == 7
    assert "NaN" not in card.inner_html()
    assert card.get_by_text("F1 against the deflection across the tyre").count() == 1
    assert "K′\n190.0 ± 1.2 kN/m" in card.inner_text()
    assert "energy lost per cycle" in card.inner_text()


def test_a_static_card_has_its_curve_and_tangents(visit):
    page = visit(campaign())
    page.locator("#static-1 summary").press("Enter")
    card = page.locator("#static-1")
    card.locator("svg").first.wait_for()  # drawn when the card has opened
    assert card.locator("svg").count() == 1
    assert card.locator(".tangent").count() == 2
    assert "NaN" not in card.inner_html()
    assert "K1 at 2000 N" in card.inner_text()


def test_a_card_without_preview_says_so(visit):
    page = visit(made([dynamic_row(1)], previews=False))
    page.locator("#dynamic-1 summary").click()
    page.locator("#dynamic-1").get_by_text("no preview is kept").wait_for()


def test_hostile_names_harm_nothing_and_keep_the_layout(visit):
    page = visit(hostile(), hostile_findings(), hostile_figures())
    for card in page.locator(".cards summary").all():
        card.click()
    page.wait_for_timeout(1000)
    assert page.locator(".card").count() == 5
    assert page.locator(f"h1:has-text({json.dumps(HOSTILE)})").count() == 1
    assert page.locator("#dynamic-1 .card").get_by_text("onerror=alert(3)").count() == 1
    heights = "rows => Math.max(...rows.map((row) => row.offsetHeight))"
    for width in (1280, 390):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.locator(".results tbody tr").evaluate_all(heights) < (60 if width == 1280 else 90)


@pytest.mark.sampled(2)
def test_a_page_is_read_without_its_script(visit):
    page = visit(varied(), java_script_enabled=False, unfold=False)
    for name in ("Every test", "Test by test"):
        page.locator("summary").get_by_role("heading", name=name).click()
    assert page.locator("#table-dynamic").get_by_text("the tyre lifts off").is_visible()
    assert page.get_by_text("the script of this page, which does not run here").is_visible()
    assert not page.locator("#filter").is_visible()


@pytest.mark.sampled(2)
def test_print_has_the_whole_tables(visit):
    remark = "the motion at the contact is no clean sine "
    rows = [dynamic_row(at, verdict="warning", remarks=remark * at) for at in range(1, 30)]
    page = visit(
        made(rows, [static_row("S1", 1000.0)]), viewport={"width": 1047, "height": 720}
    )  # A4 across within its margins, at 96 dpi
    assert page.locator("#table-dynamic .remark").first.is_visible()
    page.locator("#dynamic-1 summary").click()
    page.emulate_media(media="print")
    assert not page.locator("#filter").is_visible()
    assert not page.locator("#dynamic-2").is_visible()
    assert page.locator("#dynamic-1 svg").first.is_visible()
    # Chromium leaves boxes of buttons out of a head that it repeats on the next page.
    assert head(page, "K2").evaluate("button => getComputedStyle(button).display") == "contents"
    table = page.locator("#table-dynamic").bounding_box()
    assert table["x"] >= 0
    assert table["x"] + table["width"] <= 1047
    box = page.locator(".scroll.tall").first
    assert box.evaluate("box => box.scrollHeight <= box.clientHeight && box.scrollWidth <= box.clientWidth")
    assert page.pdf(prefer_css_page_size=True).startswith(b"%PDF")


CONTRAST = """selectors => {
  const channel = (value) => (value /= 255) <= 0.03928 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
  const light = (colour) => {
    const [r, g, b] = colour.match(/[\\d.]+/g).map(Number);
    return 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
  };
  const behind = (element) => {
    for (; element; element = element.parentElement) {
      const colour = getComputedStyle(element).backgroundColor;
      if (!/, 0\\)$/.test(colour)) return colour;
    }
    return "rgb(255, 255, 255)";
  };
  return Object.fromEntries(selectors.map((selector) => {
    const element = document.querySelector(selector);
    const [a, b] = [light(getComputedStyle(element).color), light(behind(element))].sort((x, y) => y - x);
    return [selector, (a + 0.05) / (b + 0.05)];
  }));
}"""


def test_text_stands_out_in_light_and_dark(visit):
    page = visit(varied())
    named = [
        "p.verdict",
        ".particulars dt",
        ".part > summary span",
        "a[href='#run']",
        "p.note",
        ".assumed",
        "thead small",
        "td i",
        "caption",
        ".about",
    ]
    named += ["span.ok", "span.warning", "span.rejected", "output", "figcaption", "#filter button"]
    assert faint_in_either_scheme(page, named) == []


@pytest.mark.sampled(8)
def test_a_thousand_tests_open_and_are_searched(visit, tmp_path):
    results = campaign(1000, static=10)
    page = visit(results)
    page.locator("#dynamic-777 summary").click()
    page.locator("#dynamic-777 svg").first.wait_for()
    head(page, "f").click()
    page.get_by_label("Find").fill("D77")
    assert page.locator("#shown").inner_text() == "11 of 1010 tests"
    assert (tmp_path / "report.html").stat().st_size < 9e6


@pytest.mark.parametrize("count", [1, 60])
@pytest.mark.sampled(2)
def test_the_first_page_fits_on_one_sheet(visit, count):
    report = dict.fromkeys(("laboratory", "address", "customer", "number", "operator", "approved"), "Laboratory North")
    report |= dict.fromkeys(("method", "environment", "conditioning", "break_in"), "as the procedure says, " * 3)
    rows = [dynamic_row(at, **{"pressure [Pa]": 1e5 * 1.05**at}) for at in range(1, count + 1)]
    results = with_rig_found(made(rows, stated={"report": report}))
    pictures = {key: ReportFigure(key, "Stiffness", "", drawing()) for key in ("first-stiffness", "first-tr")}
    page = visit(results, drawn=pictures, viewport={"width": 703, "height": 1000}, unfold=False)  # 186 mm
    page.emulate_media(media="print")
    box = page.locator("#front").bounding_box()
    assert box["height"] <= 269 * 96 / 25.4  # A4 within its margins
    assert page.locator("#front .summary").bounding_box()["width"] <= 703


def test_parts_are_folded_and_open_for_their_links_and_in_print(visit):
    page = visit(varied(), unfold=False)
    assert page.locator(".part[open]").count() == 0
    page.get_by_role("navigation").get_by_role("link", name="The run").click()
    page.locator(".part[open]").wait_for(state="attached")  # hashchange comes after the click
    assert page.locator(".part[open]").count() == 1
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert page.locator(".part:not([open])").count() == 0
    page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    assert page.locator(".part[open]").count() == 1


def test_a_point_of_a_figure_leads_to_the_card_of_its_test(visit):
    link = "xmlns:xlink='http://www.w3.org/1999/xlink' xlink:href='#dynamic-2'"
    inside = f"<a {link}><title>D2</title><rect width='9' height='9'/></a>"
    svg = drawing(inside=inside).replace("viewBox", 'width="504pt" height="216pt" viewBox')
    page = visit(campaign(), drawn={"stiffness": ReportFigure("stiffness", "Stiffness", "", svg)})
    page.locator(".drawing a").click()
    page.locator("#dynamic-2 .card").wait_for()
    page.locator("details#dynamic-2[open]").wait_for(state="attached")


def test_the_run_names_the_commit_where_it_is_known():
    record = {"versions": {"fourpole": "0.2.0"}, "origin": {"commit": "1a2b3c4d" * 5, "changed": True}}
    assert _versions(record)["commit of fourpole"] == "1a2b3c4d1a2b, files changed since"
    assert _versions({"versions": {"fourpole": "0.2.0"}, "origin": {"commit": None}}) == {"fourpole": "0.2.0"}
