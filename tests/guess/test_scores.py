"""init: heads as laboratories and makers write them, twins of one signal, signs, and forces at either end."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from fourpole.guess import guess_campaign
from fourpole.study import analyse
from fourpole.words.heads import column_of

RATE = 1000.0
FREQUENCIES = (8.0, 12.0, 20.0, 31.0)
LOAD = 2000.0


def stiffness(omega):
    """K* of a Zener body [N/m]."""
    return 200e3 + 1.0 / (1.0 / 120e3 + 1.0 / (1j * omega * 900.0))


def sines(hertz, *, mass=15.0, spring=12e3, blocked=False, plate=3.0, load=LOAD, seconds=3.0):
    """Channels [SI] of a specimen under a sine: its two ends 1 and 2, and the forces before and behind it."""
    omega = 2 * np.pi * hertz
    t = np.arange(int(seconds * RATE)) / RATE
    turns = np.exp(1j * omega * t)
    k, x1 = stiffness(omega), 4e-4 * np.exp(0.4j)
    x2 = 0.0 if blocked else x1 * k / (k + spring - omega**2 * mass)
    f1 = k * (x1 - x2)
    rng = np.random.default_rng(int(hertz))

    def wave(amplitude, size):
        return (amplitude * turns).real + size * rng.standard_normal(t.size)

    s = 1j * omega
    return {
        "t": t,
        "F1": load + wave(f1, 0.05),
        "F0": load + wave(f1 - omega**2 * plate * x1, 0.05),  # before the plate on which the specimen lies
        "F3": load + wave(spring * x2, 0.05),  # behind the moving mass
        "x1": 0.02 + wave(x1, 2e-8), "v1": wave(s * x1, 2e-6), "a1": wave(s * s * x1, 2e-4),
        "x2": 0.01 + wave(x2, 2e-8), "v2": wave(s * x2, 2e-6), "a2": wave(s * s * x2, 2e-4),
        "Fy": wave(0.02 * f1, 1.0), "xy": wave(0.0, 1e-6),
        "command": 0.02 + wave(1.001 * x1 * np.exp(0.1j), 0.0),
        "error": wave(0.03 * x1, 1e-6),
        "count": np.floor(hertz * t), "p": np.full(t.size, 2.1e5), "T": 23.0 + 0.01 * rng.standard_normal(t.size),
        "clipped": np.clip(wave(s * s * x1, 0.0), -0.8 * abs(s * s * x1), 0.8 * abs(s * s * x1)),
        "cycle": t % (1 / hertz), "rate": wave(s * f1, 1.0), "zero": 0.0 * t,
    }  # fmt: skip


def curve(*, seconds=40.0):
    """Channels [SI] of two slow loops from 0 to 4 kN."""
    t = np.arange(int(seconds * 20)) / 20
    x = 0.01 * (1 - np.cos(2 * np.pi * t / 20))
    rng = np.random.default_rng(3)
    load = 2e5 * x + 60.0 * np.sin(2 * np.pi * t / 20) + 0.5 * rng.standard_normal(t.size)
    return {
        "t": t, "F1": load, "F0": load, "F3": load, "x1": x, "x2": 0.0 * t, "radius": 0.3 - x, "Fy": 0.02 * load,
        "xy": 1e-6 * rng.standard_normal(t.size), "command": 1.002 * x, "error": 0.002 * x, "count": np.floor(t / 20),
        "p": np.full(t.size, 2.1e5), "T": np.full(t.size, 23.0), "cycle": t % 20, "rate": np.gradient(load, t),
        "zero": 0.0 * t, "stroke": x + 0.003, "x": 0.5 * x,
    }  # fmt: skip


@dataclass(frozen=True)
class Lab:
    """A laboratory: heads of its files with the signal of each and the recorded value of one SI unit.

    `roles` is the column of each role that is right, with "-" before one whose sign must be inverted.
    """

    dynamic: dict[str, tuple[str, float]]
    static: dict[str, tuple[str, float]]
    roles: dict[str, str]
    units: dict[str, str | None] = field(default_factory=dict)
    blocked: bool = False
    separator: str = ","
    comma: str = "."
    above: str = ""
    mass: float = 15.0

    def write(self, folder: Path) -> None:
        """Write a recording of each frequency, and a static one."""
        for hertz in FREQUENCIES if self.dynamic else ():
            channels = sines(hertz, blocked=self.blocked, mass=self.mass)
            self._table(folder / f"Lager_A_{hertz:g}Hz.csv", self.dynamic, channels)
        if self.static:
            self._table(folder / "Lager_A_static.csv", self.static, curve())

    def _table(self, path: Path, heads: dict[str, tuple[str, float]], channels: dict[str, np.ndarray]) -> None:
        columns = [factor * channels[of] for of, factor in heads.values()]
        names, rows = self.separator.join(heads), zip(*columns, strict=True)
        units = [self.units[name] for name in heads] if self.units else []
        lines = [names, *([self.separator.join(unit or "" for unit in units)] if units else [])]
        lines += [self.separator.join(f"{value:.9g}".replace(".", self.comma) for value in row) for row in rows]
        path.write_text(self.above + "\n".join(lines) + "\n", encoding="utf-8")


LABS = {
    "displacement, velocity and acceleration of one point": Lab(
        {"t [s]": ("t", 1), "Force [N]": ("F1", 1), "Disp [mm]": ("x1", 1e3), "Vel [mm/s]": ("v1", 1e3),
         "Acc [m/s^2]": ("a1", 1)},
        {"t [s]": ("t", 1), "Force [N]": ("F1", 1), "Disp [mm]": ("x1", 1e3)},
        {"force_in": "Force", "motion_in": "Disp", "load": "Force", "deflection": "Disp"},
        blocked=True,
    ),
    "two motions of each point": Lab(
        {"t [s]": ("t", 1), "Force [N]": ("F1", 1), "Acc table [m/s^2]": ("a1", 1), "Stroke [mm]": ("x1", 1e3),
         "LVDT [mm]": ("x2", 1e3), "Acc rim [m/s^2]": ("a2", 1)},
        {"t [s]": ("t", 1), "Force [N]": ("F1", 1), "Stroke [mm]": ("x1", 1e3)},
        {"force_in": "Force", "motion_in": "Acc table", "motion_out": "Acc rim", "load": "Force",
         "deflection": "Stroke"},
    ),
    "volts before newtons": Lab(
        {"t [s]": ("t", 1), "Force in [V]": ("F1", 1e-3), "Acc in [V]": ("a1", 0.1), "Force [N]": ("F1", 1),
         "acc 1 [m/s^2]": ("a1", 1), "acc 2 [m/s^2]": ("a2", 1)},
        {"t [s]": ("t", 1), "Load [V]": ("F1", 1e-3), "Travel [V]": ("x1", 100), "Load [kN]": ("F1", 1e-3),
         "Travel [mm]": ("x1", 1e3)},
        {"force_in": "Force", "motion_in": "acc 1", "motion_out": "acc 2", "load": "Load.2",
         "deflection": "Travel.2"},
    ),
    "MTS": Lab(
        {"Running Time s": ("t", 1), "Axial Count segments": ("count", 2), "Axial Displacement mm": ("x1", -1e3),
         "Axial Displacement Command mm": ("command", -1e3), "Axial Force kN": ("F1", -1e-3),
         "Axial Displacement Error mm": ("error", 1e3)},
        {"Running Time s": ("t", 1), "Axial Count segments": ("count", 2), "Axial Displacement mm": ("stroke", -1e3),
         "Axial Displacement Command mm": ("command", -1e3), "Axial Force kN": ("F1", -1e-3),
         "Axial Displacement Error mm": ("error", 1e3)},
        {"force_in": "Axial Force kN", "motion_in": "Axial Displacement mm", "load": "-Axial Force kN",
         "deflection": "-Axial Displacement mm"},
        blocked=True, separator="\t",
    ),
    "Instron": Lab(
        {"Total Time (s)": ("t", 1), "Cycle Elapsed Time (s)": ("cycle", 1), "Total Cycles": ("count", 1),
         "Position(8800 (0,1):Position) (mm)": ("x1", -1e3), "Load(8800 (0,1):Load) (kN)": ("F1", -1e-3),
         "Position Error (mm)": ("error", 1e3)},
        {"Total Time (s)": ("t", 1), "Cycle Elapsed Time (s)": ("cycle", 1), "Total Cycles": ("count", 1),
         "Position(8800 (0,1):Position) (mm)": ("stroke", -1e3), "Load(8800 (0,1):Load) (kN)": ("F1", -1e-3),
         "Position Error (mm)": ("error", 1e3)},
        {"force_in": "Load(8800 (0,1):Load)", "motion_in": "Position(8800 (0,1):Position)",
         "load": "-Load(8800 (0,1):Load)", "deflection": "-Position(8800 (0,1):Position)"},
        blocked=True, separator=";",
    ),
    "Zwick": Lab(
        {"Prüfzeit": ("t", 1), "Standardkraft": ("F1", 1), "Standardweg": ("x1", 1e3), "Traversenweg": ("zero", 1)},
        {"Prüfzeit": ("t", 1), "Standardkraft": ("F1", 1), "Standardweg": ("x1", 1e3), "Traversenweg": ("zero", 1)},
        {"force_in": "Standardkraft", "motion_in": "Standardweg", "load": "Standardkraft",
         "deflection": "Standardweg"},
        units={"Prüfzeit": "s", "Standardkraft": "N", "Standardweg": "mm", "Traversenweg": "mm"},
        blocked=True, separator=";", comma=",",
    ),
    "HBM catman": Lab(
        {"Zeit 1 - Standardmessrate [s]": ("t", 1), "Kraft_Z [kN]": ("F1", 1e-3), "Kraft_Y [kN]": ("Fy", 1e-3),
         "Beschl Pruefling unten [m/s²]": ("a1", 1), "Beschl Felge [m/s²]": ("a2", 1), "Temperatur [°C]": ("T", 1)},
        {"Zeit 1 - Standardmessrate [s]": ("t", 1), "Kraft_Z [kN]": ("F1", 1e-3), "Kraft_Y [kN]": ("Fy", 1e-3),
         "Weg WA100 [mm]": ("x1", 1e3)},
        {"force_in": "Kraft_Z", "motion_in": "Beschl Pruefling unten", "motion_out": "Beschl Felge", "load": "Kraft_Z",
         "deflection": "Weg WA100"},
        separator=";", comma=",",
    ),
    "units behind a stroke": Lab(
        {"t / s": ("t", 1), "F / kN": ("F1", 1e-3), "s / mm": ("x1", 1e3), "dF/dt / kN/s": ("rate", 1e-3)},
        {"t / s": ("t", 1), "F / kN": ("F1", 1e-3), "s / mm": ("x1", 1e3), "dF/dt / kN/s": ("rate", 1e-3)},
        {"force_in": "F / kN", "motion_in": "s / mm", "load": "F / kN", "deflection": "s / mm"},
        blocked=True, separator=";", comma=",",
    ),
    "snake case": Lab(
        {"time_s": ("t", 1), "load_cell_n": ("F1", 1), "disp_cmd_mm": ("command", 1e3), "disp_mm": ("x1", 1e3),
         "temp_c": ("T", 1), "force_rate_kn_s": ("rate", 1e-3)},
        {"time_s": ("t", 1), "load_cell_n": ("F1", 1), "disp_cmd_mm": ("command", 1e3), "disp_mm": ("x1", 1e3),
         "temp_c": ("T", 1), "force_rate_kn_s": ("rate", 1e-3)},
        {"force_in": "load_cell_n", "motion_in": "disp_mm", "load": "load_cell_n", "deflection": "disp_mm"},
        blocked=True,
    ),
    "snake case with accelerations": Lab(
        {"time_ms": ("t", 1e3), "force_in_n": ("F1", 1), "acc_base_ms2": ("a1", 1), "acc_hub_ms2": ("a2", 1)},
        {},
        {"force_in": "force_in_n", "motion_in": "acc_base_ms2", "motion_out": "acc_hub_ms2"},
    ),
    "Japanese in Latin letters": Lab(
        {"Jikan [s]": ("t", 1), "Kaju [N]": ("F1", 1), "Kasokudo shita [m/s^2]": ("a1", 1),
         "Kasokudo ue [m/s^2]": ("a2", 1)},
        {"Jikan [s]": ("t", 1), "Kaju [N]": ("F1", 1), "Heni [mm]": ("x1", 1e3)},
        {"force_in": "Kaju", "motion_in": "Kasokudo shita", "motion_out": "Kasokudo ue", "load": "Kaju",
         "deflection": "Heni"},
    ),
    "Japanese in Latin letters, without units": Lab(
        {"jikan": ("t", 1), "kajuu": ("F1", 1), "henni": ("x1", 1e3), "shirei": ("command", 1e3)},
        {"jikan": ("t", 1), "kajuu": ("F1", 1), "henni": ("x1", 1e3), "shirei": ("command", 1e3)},
        {"force_in": "kajuu", "motion_in": "henni", "load": "kajuu", "deflection": "henni"},
        blocked=True,
    ),
    "Japanese": Lab(
        {"時間[s]": ("t", 1), "荷重[kN]": ("F1", 1e-3), "変位[mm]": ("x1", 1e3), "指令[mm]": ("command", 1e3)},
        {"時間[s]": ("t", 1), "荷重[kN]": ("F1", 1e-3), "変位[mm]": ("x1", 1e3), "指令[mm]": ("command", 1e3)},
        {"force_in": "荷重", "motion_in": "変位", "load": "荷重", "deflection": "変位"},
        blocked=True,
    ),
    "French": Lab(
        {"Temps (s)": ("t", 1), "Effort (daN)": ("F1", 0.1), "Accélération moyeu (g)": ("a2", 1 / 9.80665),
         "Accélération vérin (g)": ("a1", 1 / 9.80665), "Consigne (mm)": ("command", 1e3)},
        {"Temps (s)": ("t", 1), "Effort (daN)": ("F1", 0.1), "Écrasement (mm)": ("x1", 1e3)},
        {"force_in": "Effort", "motion_in": "Accélération vérin", "motion_out": "Accélération moyeu",
         "load": "Effort", "deflection": "Écrasement"},
        separator=";", comma=",",
    ),
    "LMS": Lab(
        {"Time (s)": ("t", 1), "Force:+Z (N)": ("F1", 1), "Shaker:+Z (m/s^2)": ("a1", 1), "Rim:-Z (m/s^2)": ("a2", -1),
         "Rim:+X (m/s^2)": ("Fy", 1e-3)},
        {},
        {"force_in": "Force:+Z", "motion_in": "Shaker:+Z", "motion_out": "-Rim:-Z"},
    ),
    "models of sensors": Lab(
        {"Time (s)": ("t", 1), "208C03 SN 24311": ("F1", 1), "Ch2 352C33 SN 7001": ("a1", 1),
         "Ch3 352C33 SN 7002": ("a2", 1)},
        {},
        {"force_in": "208C03 SN 24311", "motion_in": "Ch2 352C33 SN 7001", "motion_out": "Ch3 352C33 SN 7002"},
        units={"Time (s)": "s", "208C03 SN 24311": "N", "Ch2 352C33 SN 7001": "m/s^2", "Ch3 352C33 SN 7002": "m/s^2"},
    ),
    "models of sensors in volts": Lab(
        {"Time (s)": ("t", 1), "B&K 8230 (V)": ("F1", 2.2e-3), "B&K 4507 (V)": ("a1", 1e-2),
         "B&K 4508 B (V)": ("a2", 1e-2)},
        {},
        {"force_in": "B&K 8230", "motion_in": "B&K 4507", "motion_out": "B&K 4508 B"},
    ),
    "DEWESoft": Lab(
        {"Time (s)": ("t", 1), "AI 1/Fz (N)": ("F1", 1), "AI 2/acc unten (m/s2)": ("a1", 1),
         "AI 3/acc oben (m/s2)": ("a2", 1), "AI 2/acc unten/RMS (m/s2)": ("zero", 1)},
        {},
        {"force_in": "AI 1/Fz", "motion_in": "AI 2/acc unten", "motion_out": "AI 3/acc oben"},
    ),
    "numbered channels": Lab(
        {"Time (s)": ("t", 1), "AI 1 (m/s2)": ("a2", 1), "AI 2 (N)": ("F1", 1), "AI 3 (m/s2)": ("a1", 1)},
        {},
        {"force_in": "AI 2", "motion_in": "AI 3", "motion_out": "AI 1"},
    ),
    "Calspan": Lab(
        {},
        {"ET": ("t", 1), "V": ("zero", 1), "N": ("zero", 1), "SA": ("zero", 1), "IA": ("zero", 1),
         "RL": ("radius", 1e2), "P": ("p", 1e-3), "FX": ("Fy", 1), "FY": ("Fy", 0.5), "FZ": ("F1", -1),
         "MX": ("Fy", 0.1), "RST": ("T", 1)},
        {"load": "-FZ", "deflection": "-RL"},
        units={"ET": "sec", "V": "kph", "N": "rpm", "SA": "deg", "IA": "deg", "RL": "cm", "P": "kPa", "FX": "N",
               "FY": "N", "FZ": "N", "MX": "N-m", "RST": "deg C"},
        separator="\t",
    ),
    "TYDEX": Lab(
        {},
        {"RUNTIME": ("t", 1), "FZW": ("F1", 1), "FYW": ("Fy", 1), "DSTGRWHC": ("radius", 1), "INCLANGL": ("zero", 1)},
        {"load": "FZW", "deflection": "-DSTGRWHC"},
        units={"RUNTIME": "s", "FZW": "N", "FYW": "N", "DSTGRWHC": "m", "INCLANGL": "deg"},
    ),
    "numbers of points beside words": Lab(
        {"Time (s)": ("t", 1), "FORC:1:+Z (N)": ("F1", 1), "RIM:1:+Z (m/s^2)": ("a2", 1),
         "PLTE:1:+X (m/s^2)": ("Fy", 1), "PLTE:1:+Z (m/s^2)": ("a1", 1), "RIM:3:+Z (m/s^2)": ("a2", 1.01)},
        {},
        {"force_in": "FORC:1:+Z", "motion_in": "PLTE:1:+Z", "motion_out": "RIM:1:+Z"},
    ),
    "Japanese compounds": Lab(
        {"時間[s]": ("t", 1), "横荷重[N]": ("Fy", 1), "軸荷重[N]": ("F1", 1), "出力加速度[m/s2]": ("a2", 1),
         "入力加速度[m/s2]": ("a1", 1), "空気圧[kPa]": ("p", 1e-3), "指令電圧[V]": ("command", 9)},
        {},
        {"force_in": "軸荷重", "motion_in": "入力加速度", "motion_out": "出力加速度"},
    ),
    "French with an error and a lateral force": Lab(
        {"Temps [s]": ("t", 1), "Consigne vérin [mm]": ("command", 1e3), "Déplacement vérin [mm]": ("x1", 1e3),
         "Erreur [mm]": ("error", 1e3), "Effort latéral [N]": ("Fy", 1), "Effort vertical [N]": ("F1", 1)},
        {"Temps [s]": ("t", 1), "Flèche [mm]": ("x1", 1e3), "Effort latéral [N]": ("Fy", 1),
         "Effort vertical [N]": ("F1", 1)},
        {"force_in": "Effort vertical", "motion_in": "Déplacement vérin", "load": "Effort vertical",
         "deflection": "Flèche"},
        blocked=True, separator=";", comma=",",
    ),
    "two displacement sensors on one plate": Lab(
        {"t [s]": ("t", 1), "F [N]": ("F1", 1), "LVDT 1 [mm]": ("x1", 1e3), "LVDT 2 [mm]": ("x1", 1.001e3)},
        {"t [s]": ("t", 1), "F [N]": ("F1", 1), "LVDT 1 [mm]": ("x1", 1e3), "LVDT 2 [mm]": ("x1", 1.001e3)},
        {"force_in": "F", "motion_in": "LVDT 1", "load": "F", "deflection": "LVDT 1"},
        blocked=True,
    ),
    "symbols without units": Lab(
        {"t": ("t", 1), "F": ("F1", 1), "x": ("x1", 1e3), "v": ("v1", 1e3)},
        {"t": ("t", 1), "F": ("F1", 1), "x": ("x1", 1e3)},
        {"force_in": "F", "motion_in": "x", "load": "F", "deflection": "x"},
        blocked=True,
    ),
    "a force before a plate": Lab(
        {"t [s]": ("t", 1), "Force A [N]": ("F0", 1), "Force B [N]": ("F1", 1), "Weg [mm]": ("x1", 1e3)},
        {},
        {"force_in": "Force B", "motion_in": "Weg"},
        blocked=True,
    ),
    "a force behind the moving mass": Lab(
        {"t [s]": ("t", 1), "Force A [N]": ("F3", 1), "Force B [N]": ("F1", 1), "acc in [m/s^2]": ("a1", 1),
         "acc out [m/s^2]": ("a2", 1)},
        {},
        {"force_in": "Force B", "motion_in": "acc in", "motion_out": "acc out"},
    ),
    "an accelerometer upside down on the plate of the stroke": Lab(
        {"t [s]": ("t", 1), "Kraft [N]": ("F1", 1), "Kolbenweg [mm]": ("x1", 1e3), "Beschleunigung [m/s2]": ("a1", -1)},
        {},
        {"force_in": "Kraft", "motion_in": "Kolbenweg"},
        blocked=True,
    ),
    "a clipped twin": Lab(
        {"t [s]": ("t", 1), "Kraft [N]": ("F1", 1), "Beschl Tisch [m/s2]": ("clipped", 1),
         "Beschl Tisch 100 g [m/s2]": ("a1", 1), "Beschl Masse [m/s2]": ("a2", 1)},
        {},
        {"force_in": "Kraft", "motion_in": "Beschl Tisch 100 g", "motion_out": "Beschl Masse"},
    ),
    "load and stroke of unlike signs": Lab(
        {},
        {"t [s]": ("t", 1), "Load [kN]": ("F1", -1e-3), "Stroke [mm]": ("stroke", 1e3)},
        {"load": "-Load", "deflection": "Stroke"},
    ),
    "a stroke that falls from far above under a negative load": Lab(
        {},
        {"t [s]": ("t", 1), "Load [kN]": ("F1", -1e-3), "Position [mm]": ("radius", 1e3)},
        {"load": "-Load", "deflection": "-Position"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LABS)
def test_the_columns_of_a_laboratory(name, tmp_path):
    lab = LABS[name]
    lab.write(tmp_path)
    guess = guess_campaign(tmp_path)
    found = {role: ("-" if one.invert else "") + one.column for role, one in guess.roles.items()}
    assert found == lab.roles
    assert guess.blocked == (lab.blocked and bool(lab.dynamic))


@pytest.mark.parametrize(
    "name", [name for name, lab in LABS.items() if lab.dynamic and "volts" not in name.split()[-1:]]
)
@pytest.mark.sampled(6)
def test_the_stiffness_of_a_laboratory_is_right_without_an_edit(name, tmp_path):
    LABS[name].write(tmp_path)
    guess_campaign(tmp_path).write()
    found = analyse(tmp_path, route="joint" if LABS[name].blocked else "relative").dynamic
    seen = found["Re K* [N/m]"].to_numpy() + 1j * found["Im K* [N/m]"].to_numpy()
    exact = stiffness(2 * np.pi * found["frequency [Hz]"].to_numpy())
    np.testing.assert_allclose(seen, exact, rtol=2e-3)
    assert set(found["K1 [N/m]"]) <= {None} or found["K1 [N/m]"].to_numpy() == pytest.approx(200e3, rel=1e-3)


@pytest.mark.parametrize("digits", ["%.5g", "%.3f"])
def test_a_random_recording_with_times_of_a_few_digits_has_its_band(digits, tmp_path):
    rate, count = 2048.0, 32 * 2048
    lines = np.fft.rfft(np.random.default_rng(1).standard_normal(count))
    lines[~((np.fft.rfftfreq(count, 1 / rate) > 5) & (np.fft.rfftfreq(count, 1 / rate) < 100))] = 0.0
    x = np.fft.irfft(lines, count)
    times = (digits % time for time in np.arange(count) / rate)
    rows = (f"{time},{200 * each:.6g},{each:.6g}" for time, each in zip(times, x, strict=True))
    (tmp_path / "mount_random.csv").write_text("\n".join(["Time (s),Force (N),Displacement (mm)", *rows]) + "\n")
    (row,) = guess_campaign(tmp_path).rows
    assert (row.kind, row.band) == ("random", pytest.approx((5, 100), rel=0.2))


@pytest.mark.parametrize(
    ("head", "unit", "found"),
    [
        ("load_cell_kn", None, ("force", "kN")),
        ("force_rate_kn_s", None, ("other", "kN/s")),
        ("acc_m_s2", None, ("acceleration", "m/s^2")),
        ("temp_c", None, ("temperature", "degC")),
        ("a / (m/s²)", None, ("acceleration", "m/s²")),
        ("Kraft in N", None, ("force", "N")),
        ("x_in", None, ("displacement", None)),
        ("Zeit t", None, ("time", None)),
        ("T_Reifen", None, ("temperature", None)),
        ("Load", "KN", ("force", "kN")),
        ("Load", "LBF", ("force", "lbf")),
        ("Force rate", "kN/s", ("other", "kN/s")),
        ("Mz", "Nm", ("other", "Nm")),
        ("Cycle", None, ("other", None)),
        ("Position Error", "mm", ("other", "mm")),
        ("Time  1 - default sample rate", None, ("time", None)),
    ],
)
def test_the_quantity_and_the_unit_of_a_head(head, unit, found):
    column = column_of(head, unit)
    assert (column.quantity, column.unit) == found


@pytest.mark.parametrize("heads", [("Fz1", "Fz2", "Fz3", "Fz4", "Fz gesamt"), ("F1", "F2", "F3", "F4", "Fsum")])
def test_the_sum_of_forces_is_the_force(tmp_path, heads):
    """A plate on four cells, of which the first head is that of a part."""
    for hertz in FREQUENCIES:
        made = sines(hertz, blocked=True)
        parts = [share * made["F1"] for share in (0.26, 0.24, 0.3, 0.2)]
        columns = [made["t"], 1e3 * made["x1"], *parts, sum(parts)]
        head = ",".join(["Zeit [s]", "Weg [mm]", *(f"{name} [N]" for name in heads)])
        np.savetxt(
            tmp_path / f"{hertz:g}Hz.csv", np.c_[tuple(columns)], delimiter=",", header=head, comments="", fmt="%.9g"
        )
    assert guess_campaign(tmp_path).roles["force_in"].column == heads[-1]
