"""A campaign on its way: recordings of networks with noise of a stated size, and results with the tolerance it allows.

Each recording is a sum of tones whose amplitudes come from `physics`, with an offset, and Gaussian noise of a standard
deviation that is stated here. A tolerance is five standard uncertainties by the Cramér-Rao bound of that noise.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mpmath import mp, mpc, mpf

from reference.physics import J, Numbers, amplitudes, turning

RATE, SAMPLES = 300, 300
#: Noise over amplitude, and standard uncertainties within which a result must lie.
NOISE, WITHIN = mpf("1e-4"), 5
#: Noise as it may be estimated, over what it is: two standard uncertainties for 16 degrees of freedom.
ESTIMATED = mpf("1.36")
_STEP = mpf(10) ** -15
HEADS = ("table", "row", "column", "expected", "tolerance", "rests on", "route")


@dataclass
class Campaign:
    """A campaign on its way: statement, rows of tests.csv, recordings and expected results."""

    name: str
    route: str
    statement: str
    columns: str
    seed: int
    tests: list[str] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)
    rows: list[tuple[str, ...]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.random = random.Random(self.seed)

    def expect(self, table: str, row: str, column: str, value: Any, tolerance: Any, why: str) -> None:
        """Note an expected number."""
        texts = (mp.nstr(mpf(value), 17), mp.nstr(mpf(tolerance), 3))
        self.rows.append((table, row, column, *texts, why, self.route))

    def expect_word(self, table: str, row: str, column: str, word: str, why: str) -> None:
        """Note an expected text."""
        self.rows.append((table, row, column, word, "", why, self.route))

    def tones(self, test: str, columns: Mapping[str, mpc], frequency: float, offsets: Mapping[str, float]) -> None:
        """A recording of one tone per column, with noise of `NOISE` of its amplitude."""
        series = []
        for name, amplitude in columns.items():
            std = float(NOISE * abs(amplitude))
            samples = [
                float((amplitude * mp.expj(2 * mp.pi * mpf(frequency) * at / RATE)).real)
                + offsets.get(name, 0.0)
                + self.random.gauss(0.0, std)
                for at in range(SAMPLES)
            ]
            series.append([f"{one:.7g}" for one in samples])
        self.files[f"recordings/{test}.csv"] = table_text(list(columns), zip(*series, strict=True))

    def write(self, folder: Path) -> None:
        """Write the folder of the campaign."""
        (folder / self.name / "recordings").mkdir(parents=True, exist_ok=True)
        expected = table_text(HEADS, self.rows)
        files = {
            "campaign.toml": self.statement,
            "tests.csv": "\n".join([self.columns, *self.tests]) + "\n",
            "expected.csv": expected,
            **self.files,
        }
        for name, text in files.items():
            (folder / self.name / name).write_text(text, encoding="utf-8")


def table_text(heads: Sequence[str], rows: Any) -> str:
    """Rows of cells below their heads, as CSV."""
    return "\n".join(",".join(f'"{cell}"' if "," in cell else cell for cell in row) for row in (heads, *rows)) + "\n"


def u_of_part(amplitude: mpc) -> mpf:
    """Cramér-Rao bound of the real or the imaginary part of an amplitude in white noise."""
    return NOISE * abs(amplitude) * mp.sqrt(mpf(2) / SAMPLES)


def u_of_frequency(channels: int) -> mpf:
    """Cramér-Rao bound of a frequency [Hz] that several channels share, each with the noise `NOISE`."""
    duration = mpf(SAMPLES) / RATE
    return mp.sqrt(24 / (channels * SAMPLES)) * NOISE / duration / (2 * mp.pi)


def spread(
    results: Callable[[Numbers], Mapping[str, mpf]], v: Numbers, along: Sequence[Mapping[str, mpf]]
) -> dict[str, mpf]:
    """Standard uncertainty of each result from independent errors, each given as a change of the inputs."""
    squares: dict[str, mpf] = {}
    for error in along:
        up, down = (results({**v, **{k: v[k] + sign * _STEP * by for k, by in error.items()}}) for sign in (1, -1))
        for name in up:
            squares[name] = squares.get(name, mpf(0)) + ((up[name] - down[name]) / (2 * _STEP)) ** 2
    return {name: mp.sqrt(square) for name, square in squares.items()}


def recorded(v: Numbers, *, cam: float = 1e-3, blocked: bool = False) -> dict[str, mpc]:
    """F1, V1 and V2 of a tyre on its rig with a cam of this amplitude [m]."""
    f1, v1, v2 = amplitudes(v, blocked=blocked)
    scale = J * turning(v) * mpf(cam) / v1 * mp.expj(mpf("0.3"))
    return {"F1": f1 * scale, "V1": v1 * scale, "V2": v2 * scale}


def parts_of(values: Mapping[str, mpc]) -> dict[str, mpf]:
    """Real and imaginary parts of amplitudes as inputs of `spread`."""
    return {f"{part} {name}": getattr(one, where) for name, one in values.items()
            for part, where in (("Re", "real"), ("Im", "imag"))}  # fmt: skip


def noise_of(values: Mapping[str, mpc]) -> list[dict[str, mpf]]:
    """The errors of amplitudes from noise, and that of the frequency."""
    errors = [{f"{part} {name}": u_of_part(one)} for name, one in values.items() for part in ("Re", "Im")]
    return [*errors, {"frequency": u_of_frequency(len(values))}]


def u_head(head: str) -> str:
    """Head of the uncertainty of a column."""
    name, _, unit = head.replace("TR predicted", "TR").partition(" [")
    return f"u({name}) [{unit}"
