"""Names of recordings as people give them: every scheme is told apart, and what is doubtful is said."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import polars as pl
import pytest

from fourpole.campaign import read_campaign
from fourpole.guess import guess_campaign
from fourpole.virtual import simulate_campaign

pytestmark = pytest.mark.thorough

PRESSURES, PRELOADS, FREQUENCIES = (1.7, 2.4), (1000.0, 1500.0), (10.0, 12.5)


@dataclass(frozen=True)
class Case:
    """One recording of the bare folder: what it is in truth."""

    source: str
    index: int
    kind: str
    tyre: str
    pressure: float  # bar
    preload: float | None  # N
    frequency: float | None  # Hz

    @property
    def static(self) -> bool:
        return self.kind == "static"

    def said(self, dynamic: str, static: str) -> str:
        """One of two patterns, filled in."""
        words = {
            "radial": "radial" if self.tyre.startswith("radial") else "crossply",
            "Radial": "Radial" if self.tyre.startswith("radial") else "Diagonal",
            "R": "R" if self.tyre.startswith("radial") else "C",
            "rad": "rad" if self.tyre.startswith("radial") else "xply",
            "A": "A" if self.tyre.startswith("radial") else "B",
            "one": "1" if self.tyre.startswith("radial") else "2",
            "дж": "Радиал" if self.tyre.startswith("radial") else "Диагональ",
            "径": "径向" if self.tyre.startswith("radial") else "斜交",
            "ply": "Radial-Ply" if self.tyre.startswith("radial") else "Cross-Ply",
            "x ply": "radial ply" if self.tyre.startswith("radial") else "cross ply",
            "slash": "205_55R16" if self.tyre.startswith("radial") else "195_65 R15",
            "size": "205-55R16" if self.tyre.startswith("radial") else "5.60-13",
        }
        p, load, f = self.pressure, self.preload or 0.0, self.frequency or 0.0
        numbers = {
            "i": self.index,
            "bar": f"{p:g}",
            "comma": f"{p:g}".replace(".", ","),
            "under": f"{p:g}".replace(".", "_"),
            "ppp": f"{p:g}".replace(".", "p"),
            "tenths": f"{p * 10:.0f}",
            "kPa": f"{p * 100:.0f}",
            "psi": f"{p * 14.503774:.2f}",
            "N": f"{load:.0f}",
            "kN": f"{load / 1000:g}",
            "kNp": f"{load / 1000:.1f}".replace(".", "p"),
            "lbf": f"{load * 0.22480894:.2f}",
            "f": f"{f:g}",
            "fp": f"{f:.1f}".replace(".", "p"),
            "fcomma": f"{f:g}".replace(".", ","),
            "rpm": f"{f * 60:.0f}",
            "mbar": f"{p * 1000:.0f}",
            "MPa": f"{p / 10:.3g}",
            "kg": f"{load / 9.80665:.2f}",
            "f_then": f"{f:g}",
            "who": ("MK", "JB", "SE")[self.index % 3],
            "clock": f"{9 + self.index // 60:02d}{self.index % 60:02d}17",
        }
        return (static if self.static else dynamic).format(**words, **numbers)


def by_name(dynamic: str, static: str) -> Callable[[Path, Case, Path], None]:
    """Copy each recording under a name made of a pattern."""

    def copy(folder: Path, case: Case, source: Path) -> None:
        target = folder / f"{case.said(dynamic, static)}.csv"
        target.parent.mkdir(parents=True, exist_ok=True)
        assert not target.exists()
        shutil.copy(source, target)

    return copy


def by_header(dynamic: str, static: str, name: str = "rec_{i:04d}") -> Callable[[Path, Case, Path], None]:
    """Write lines above the table of each recording."""

    def copy(folder: Path, case: Case, source: Path) -> None:
        target = folder / f"{case.said(name, name)}.csv"
        target.write_text(case.said(dynamic, static) + source.read_text())

    return copy


def by_sidecar(dynamic: str, static: str, ending: str = ".txt") -> Callable[[Path, Case, Path], None]:
    """Write a file of notes beside each recording."""

    def copy(folder: Path, case: Case, source: Path) -> None:
        stem = f"rec_{case.index:04d}"
        shutil.copy(source, folder / f"{stem}.csv")
        (folder / f"{stem}{ending}").write_text(case.said(dynamic, static))

    return copy


#: What is told by each scheme of names: all, or less.
ALL = ("kind", "tyre", "pressure", "preload", "frequency")
SCHEMES: dict[str, tuple[Callable[[Path, Case, Path], None], tuple[str, ...]]] = {
    "telling": (by_name("{radial}_{bar}bar_{N}N_{f}Hz", "{radial}_{bar}bar_static"), ALL),
    "sizes": (by_name("{size} p{bar} L{N}N f{f}", "{size} p{bar} static"), ALL),
    "german": (by_name("{Radial}_{kPa}kPa_Vorlast{N}N_{f}Hz_Kraft", "{Radial}_{kPa}kPa_statisch_Kraft"), ALL),
    "letters": (by_name("{R}_p{kPa}kPa_Fz{kN}kN_f{f}", "{R}_p{kPa}kPa_stat"), ALL),
    "bare numbers": (by_name("{radial}_{bar}_{N}_{f}", "{radial}_{bar}_static"), ALL),
    "folders": (by_name("{radial}/{bar} bar/{N} N/{f} Hz", "{radial}/{bar} bar/static"), ALL),
    "decimal commas": (by_name("{Radial} {comma} bar {N} N {fcomma} Hz", "{Radial} {comma} bar statisch"), ALL),
    "p for the point": (by_name("{radial}_{ppp}bar_{kNp}kN_{fp}Hz", "{radial}_{ppp}bar_static"), ALL),
    "dates": (
        by_name("20240312_{clock}_{radial}_{bar}bar_{N}N_{f}Hz_v2", "20240312_{clock}_{radial}_{bar}bar_static_v2"),
        ALL,
    ),
    "serials": (by_name("SN4711-{i:04d}_tyre{A}_{psi}psi_{lbf}lbf_{f}Hz", "SN4711-{i:04d}_tyre{A}_{psi}psi_LD"), ALL),
    "keys": (by_name("tyre={radial},p={bar}bar,F={N}N,f={f}Hz", "tyre={radial},p={bar}bar,static"), ALL),
    "header": (
        by_header(
            "Tyre: {radial}\nPressure: {bar} bar\nPreload: {N} N\nFrequency: {f} Hz\n",
            "Tyre: {radial}\nPressure: {bar} bar\nTest: static\n",
        ),
        ALL,
    ),
    "German header": (
        by_header(
            "Reifen;{Radial}\nLuftdruck [bar];{comma}\nVorlast [kN];{kN}\nPrüfer;Müller\nDatum;12.03.2024\n",
            "Reifen;{Radial}\nLuftdruck [bar];{comma}\nPrüfer;Müller\nDatum;12.03.2024\n",
            "Messung {i}",
        ),
        ALL,
    ),
    "sidecar": (
        by_sidecar(
            "tyre = {radial}\ninflation pressure = {kPa} kPa\npreload = {N} N\n",
            "tyre = {radial}\ninflation pressure = {kPa} kPa\n",
        ),
        ALL,
    ),
    "tenths": (by_name("{rad}_p{tenths}_L{N}_f{f}_r1", "{rad}_p{tenths}_static_r1"), ALL),
    "rpm": (by_name("{radial}-{bar}bar-{N}N-{rpm}rpm", "{radial}-{bar}bar-quasistatic"), ALL),
    "underscores": (by_name("{radial}_{under}bar_{N}N_{f}Hz", "{radial}_{under}bar_static"), ALL),
    "final": (by_name("{radial} {bar}bar {N}N {f}Hz run1 final (2)", "{radial} {bar}bar static run1 final (2)"), ALL),
    "french": (
        by_name(
            "pneu_{Radial}_pression{bar}bar_precharge{N}N_freq{f}Hz_essai{i}",
            "pneu_{Radial}_pression{bar}bar_statique_essai{i}",
        ),
        ALL,
    ),
    "glued": (by_name("{radial}{bar}bar{N}N{f}Hz", "{radial}{bar}barstatic"), ALL),
    "camels": (by_name("{Radial}P{kPa}L{N}F{f}", "{Radial}P{kPa}Static"), ALL),
    "more": (
        by_name(
            "2024-03-12 {radial} {bar}bar {N}N {f}Hz 23C m0kg rep{i}", "2024-03-12 {radial} {bar}bar LD 23C rep{i}"
        ),
        ALL,
    ),
    "statics apart": (by_name("dynamic/{radial}_{bar}bar_{N}N_{f}Hz", "static/{radial}_{bar}bar"), ALL),
    "versions": (by_name("V2.4_{radial}_{bar}bar_{N}N_{f}Hz_rev3", "V2.4_{radial}_{bar}bar_static_rev3"), ALL),
    "short dates": (
        by_name("12-03-24_14-05-33_{radial}_{bar}bar_{N}N_{f}Hz", "12.03.2024 14h05 {radial} {bar}bar static"),
        ALL,
    ),
    "dashes": (by_name("Test {i} - {Radial} - {bar} - {N} - {f}Hz", "Test {i} - {Radial} - {bar} - statisch"), ALL),
    "capitals": (by_name("{Radial}_{kPa}KPA_{kN}KN_{f}HZ", "{Radial}_{kPa}KPA_STATIC"), ALL),
    "partial sizes": (by_name("{slash}_{bar}bar_{N}N_{f}Hz", "{slash}_{bar}bar_static"), ALL),
    "T1 and T2": (by_name("T{one}_p{bar}_L{N}_f{f}", "T{one}_p{bar}_static"), ALL),
    "tyre1": (by_name("tyre{one}_{bar}bar_{N}N_{f}Hz", "tyre{one}_{bar}bar_static"), ALL),
    "tyre 1": (by_name("tyre {one} {bar}bar {N}N {f}Hz", "tyre {one} {bar}bar static"), ALL),
    "#1": (by_name("#{one} {bar} bar, {N} N, {f} Hz", "#{one} {bar} bar, Kennlinie"), ALL),
    "D and S": (by_name("D{i}", "S{i}"), ("kind", "frequency")),
    "mbar": (by_name("{radial}_{mbar}mbar_{N}N_{f}Hz", "{radial}_{mbar}mbar_static"), ALL),
    "MPa": (by_name("{radial}_{MPa}MPa_{N}N_{f}Hz", "{radial}_{MPa}MPa_static"), ALL),
    "brackets": (by_name("{radial}_P[{bar}bar]_F[{N}N]_({f}Hz)", "{radial}_P[{bar}bar]_static"), ALL),
    "keyed folders": (by_name("{radial}/p={bar}/F={N}/f={f}", "{radial}/p={bar}/static"), ALL),
    "all keys": (by_name("{radial}_T23_p{bar}_Fz{N}_f{f}_A1.0", "{radial}_T23_p{bar}_static"), ALL),
    "filter": (by_name("filter100Hz_{radial}_{bar}bar_{N}N_{f}Hz", "filter100Hz_{radial}_{bar}bar_static"), ALL),
    "Cyrillic": (by_name("{дж}_{bar}bar_{N}N_{f}Hz", "{дж}_{bar}bar_static"), ALL),
    "Chinese": (by_name("{径}{bar}bar{N}N{f}Hz", "{径}{bar}bar_static"), ALL),
    "kilograms": (by_name("{radial}_{bar}bar_{kg}kg_{f}Hz", "{radial}_{bar}bar_static"), ALL),
    "both kinds": (
        by_name("static and dynamic/{radial} {bar}bar {N}N {f}Hz", "static and dynamic/{radial} {bar}bar"),
        ALL,
    ),
    "glued kinds": (by_name("dyn{bar}bar_{N}N_{f}Hz_{radial}", "stat{bar}bar_{radial}"), ALL),
    "shouting": (by_name("{ply} {bar}BAR {N}N {f}HZ SINE", "{ply} {bar}BAR LOAD-DEFLECTION"), ALL),
    "two words": (by_name("{x ply} {bar}bar {N}N {f}Hz", "{x ply} {bar}bar static"), ALL),
    "bare kPa": (by_name("{radial}_{kPa}_{N}_{f}", "{radial}_{kPa}_static"), ALL),
    "counted": (by_name("{i}_{radial}_{bar}bar_{N}N_{f}Hz", "{i}_{radial}_{bar}bar_static"), ALL),
    "counted bare": (by_name("{i}_{radial}_{bar}_{N}_{f}", "{i}_{radial}_{bar}_static"), ALL),
    "counted behind": (by_name("{radial}_{bar}bar_{N}N_{f}Hz_{i:03d}", "{radial}_{bar}bar_static_{i:03d}"), ALL),
    "dots": (by_name("{radial}.{bar}bar.{N}N.{f}Hz", "{radial}.{bar}bar.static"), ALL),
    "dashed units": (by_name("{radial}_{bar}-bar_{N}-N_{f}-Hz", "{radial}_{bar}-bar_static"), ALL),
    "sine10": (by_name("{radial}_{bar}bar_{N}N_sine{f}", "{radial}_{bar}bar_quasi-static"), ALL),
    "project": (
        by_name("ProjX_4711_{radial}_{bar}bar_{N}N_{f}Hz_Kanal3", "ProjX_4711_{radial}_{bar}bar_Federkennlinie_Kanal3"),
        ALL,
    ),
    "one preload letter": (by_name("{radial} P{bar} F{N} {f}Hz", "{radial} P{bar} stat"), ALL),
    "space for the unit": (
        by_name("{radial} tyre at {bar} bar and {N} N, {f} Hz", "{radial} tyre at {bar} bar, slow"),
        ALL,
    ),
    "units first": (by_name("{radial} bar{bar} N{N} Hz{f}", "{radial} bar{bar} static"), ALL),
    "whole words glued": (by_name("{radial}{one}Press{bar}Load{N}Freq{f}", "{radial}{one}Press{bar}Static"), ALL),
    "a range": (by_name("{radial}_p={bar}_F={N}_f={f}", "{radial}_p={bar}_F=0-3000_static"), ALL),
    "dated folders": (by_name("2024/03/12/{radial}/{kPa}kPa/L{N}/f{f}", "2024/03/12/{radial}/{kPa}kPa/static"), ALL),
    "job numbers": (
        by_name("J1234567_{radial}_{bar}bar_{N}N_{f}Hz_fs1kHz_16bit", "J1234567_{radial}_{bar}bar_stat"),
        ALL,
    ),
    "an unknown unit": (
        by_name("{radial}-{bar}b-{N}N-{f}hz", "{radial}-{bar}b-stat"),
        ("kind", "tyre", "preload", "frequency"),
    ),
    "bare header": (by_header("Pressure,{bar}\nPreload,{N}\nTyre,{radial}\n", "Pressure,{bar}\nTyre,{radial}\n"), ALL),
    "JSON beside": (
        by_sidecar(
            '{{"tyre": "{radial}", "pressure_bar": {bar}, "preload_N": {N}}}\n',
            '{{"tyre": "{radial}", "pressure_bar": {bar}}}\n',
            ".json",
        ),
        ALL,
    ),
    "comments": (
        by_header("# {radial} tyre, {bar} bar, {N} N\n# sampling rate 1000 Hz\n", "# {radial} tyre, {bar} bar\n"),
        ("kind", "pressure", "preload", "frequency"),
    ),
    "unhelpful": (by_name("rec_{i:04d}", "rec_{i:04d}"), ("kind", "frequency")),
    "hashes": (by_name("9f{i:04x}c3a1b", "9f{i:04x}c3a1b"), ("kind", "frequency")),
    "clocks": (by_name("20240312_{clock}", "20240312_{clock}"), ("kind", "frequency")),
}


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Case, Path]]:
    """Recordings of two tyres at two pressures and preloads, without noise; the dynamic ones are cut to 1 s."""
    found = truth(tmp_path_factory.mktemp("origin"))
    for case, source in found:
        if not case.static:
            source.write_text("".join(source.read_text().splitlines(keepends=True)[:1001]))
    return found


def truth(place: Path) -> list[tuple[Case, Path]]:
    """Record a campaign and list what each recording is."""
    made = simulate_campaign(
        place, clean=True, pressures=[p * 1e5 for p in PRESSURES], preloads=PRELOADS, frequencies=FREQUENCIES
    )
    table = pl.read_csv(made.folder / "tests.csv")
    return [
        (
            Case(
                row["test"], index, row["kind"], row["tyre"], row["pressure [bar]"], row["preload [N]"],
                row["frequency [Hz]"],
            ),
            made.folder / row["file"],
        )
        for index, row in enumerate(table.iter_rows(named=True), 1)
    ]  # fmt: skip


def laid_out(folder: Path, scheme: str, cases: list[tuple[Case, Path]]) -> dict[str, Case]:
    """Lay the recordings out by a scheme: what each file is in truth."""
    put, _ = SCHEMES[scheme]
    found: dict[str, Case] = {}
    for case, source in cases:
        before = set(folder.rglob("*.csv"))
        put(folder, case, source)
        (new,) = set(folder.rglob("*.csv")) - before
        found[new.relative_to(folder).as_posix()] = case
    return found


def score(folder: Path, origin: dict[str, Case]) -> dict[str, tuple[int, int, int]]:
    """Of each thing to be told: how many tests have it right, wrong, and blank."""
    guess = guess_campaign(folder)
    guess.write()
    campaign = read_campaign(folder)
    counts = {name: [0, 0, 0] for name in ALL}
    tyres: dict[str, set[str]] = {}
    for test in campaign.tests:
        case = origin[test.file]
        tyres.setdefault(test.tyre, set()).add(case.tyre)
    for test in campaign.tests:
        case = origin[test.file]
        counts["kind"][0 if test.kind == case.kind else 1] += 1
        counts["tyre"][0 if len(tyres[test.tyre]) == 1 and len(tyres) == 2 else 2 if len(tyres) == 1 else 1] += 1
        for name, scale in (("pressure", 1e5), ("preload", 1.0), ("frequency", 1.0)):
            true, value = getattr(case, name), test.value(name)
            if true is None:
                counts[name][0 if value is None else 1] += 1
            else:
                right = value is not None and abs(value - true * scale) < 2e-3 * true * scale
                counts[name][0 if right else 2 if value is None else 1] += 1
    for name in ALL:
        counts[name][2] += len(origin) - len(campaign.tests)
    return {name: (right, wrong, blank) for name, (right, wrong, blank) in counts.items()}


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.sampled(6)
def test_a_scheme_of_names_is_understood(scheme, cases, tmp_path):
    origin = laid_out(tmp_path, scheme, cases)
    for name, (right, wrong, blank) in score(tmp_path, origin).items():
        if name in SCHEMES[scheme][1]:
            assert (right, wrong, blank) == (len(origin), 0, 0), name
        else:
            assert wrong == 0, name


def test_words_that_vary_beside_the_tyre_are_doubted(cases, tmp_path):
    """Operators at random: the tyres are told apart by them too, which is said."""
    for case, source in cases:
        by_name("{who}_{radial}_{bar}bar_{N}N_{f}Hz", "{who}_{radial}_{bar}bar_static")(tmp_path, case, source)
    (doubt,) = [doubt for doubt in guess_campaign(tmp_path).doubts if doubt.about == "tyre"]
    assert "6 specimens by the words that vary (" in doubt.text
    assert "take them out" in doubt.text


def test_unhelpful_names_give_one_doubt_of_each_kind(cases, tmp_path):
    laid_out(tmp_path, "unhelpful", cases)
    guess = guess_campaign(tmp_path)
    unknown = {doubt.about: len(doubt.tests) for doubt in guess.doubts if doubt.tests}
    assert unknown == {"tyre": 20, "pressure": 20, "preload": 16}
    assert {row.tyre for row in guess.rows} == {"tyre"}
