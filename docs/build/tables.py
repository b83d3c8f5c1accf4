"""The tables of the documentation that are computed; each stands in its page between two marks."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import passive_tyre as pt

from fourpole.core.components import COMPONENTS, Shape

DOCS = Path(__file__).resolve().parent.parent
_EXAMPLES = (10.0, 14.0, 18.0, 24.0)
#: Largest size of a fault that is tried, by its unit.
_MOST = {"%": 30.0, "kg": 5.0, "°": 5.0, "s": 1e4}
_RANDOM = 200


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown."""
    lines = [list(heads), *map(list, rows)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join(f"| {' | '.join(one)} |" for one in lines)


def size(fault: pt.Fault, value: float | None = None) -> str:
    """The size of a fault with its unit; "no" for none."""
    if value is None:
        return "no"
    digits = 1 if value >= 1 else 2
    number = f"{value:.0f}" if value == round(value) else f"{value:.{digits}f}"
    return number + ("" if fault.unit == "°" else " ") + fault.unit


def _by_fault(which: int, scale: float, digits: int, more: Callable[[np.ndarray], list[str]]) -> Iterator[list[str]]:
    """A row for the truth and for each fault: K2 or C of the page's tyre at the frequencies, and more of it."""
    at = np.searchsorted(pt.FREQUENCY, _EXAMPLES)
    for fault in (None, *pt.FAULTS):
        values = pt.example(fault)[which]
        name = f"{fault.name}: {size(fault, fault.size)}" if fault else "none: the truth"
        yield [name, *(f"{scale * one:.{digits}f}" for one in values[at]), *more(values)]


def _line(values: np.ndarray) -> str:
    return "rises" if pt.slope(values) > 0 else "falls"


def c_by_fault() -> str:
    """C of the page's tyre with each fault."""

    def over_band(c: np.ndarray) -> list[str]:
        highest = pt.top(c)
        return ["falls" if highest == pt.FREQUENCY[0] else f"rises to {highest:g} Hz", _line(c)]

    heads = [f"{f:g} Hz" for f in _EXAMPLES]
    return table(["C [N s/m] with", *heads, "from 10 to 24 Hz", "its line"], _by_fault(1, 1.0, 0, over_band))


def k2_by_fault() -> str:
    """K2 of the page's tyre with each fault."""
    heads = [f"{f:g} Hz" for f in _EXAMPLES]
    return table(["K2 [kN/m] with", *heads, "its line"], _by_fault(0, 1e-3, 1, lambda k2: [_line(k2)]))


def where_it_turns() -> str:
    """The least size of each fault at which C rises."""
    rows = []
    for fault in pt.FAULTS:
        found = (pt.least_size(fault, turn, _MOST[fault.unit]) for turn in pt.TURNS.values())
        rows.append([fault.name, size(fault, _MOST[fault.unit]), *(size(fault, one) for one in found)])
    return table(["what is off", "tried up to", *pt.TURNS], rows)


def of_random_tyres() -> str:
    """How many of the random passive tyres show a rising C with each fault."""
    rows = []
    for fault in (one for one in pt.FAULTS if one.unit != "s"):  # the share of a loop is that of one tyre
        k2, c = pt.of_random_tyres(fault, _RANDOM)
        usable = np.all((c > 0) & (k2 > 0), axis=1)
        k2, c = k2[usable], c[usable]
        up = np.diff(c, axis=1) > 0
        shares = [
            up.any(axis=1),
            np.array([pt.slope(one) > 0 for one in c]),
            up.all(axis=1),
            np.array([pt.slope(one) > 0 for one in k2]),
        ]
        named = f"{fault.name}: {size(fault, fault.size)}"
        rows.append([named, f"{usable.sum()}", *(f"{100 * one.mean():.0f} %" for one in shares)])
    heads = ["what is off", f"usable of {_RANDOM}", "C rises somewhere", "its line rises", "C rises throughout"]
    return table([*heads, "line of K2 rises"], rows)


#: The ratios of `over_pressure`: what is compared, and the values by condition that it takes.
_RATIOS = ("C, 2.4 over 1.0 bar", "C, 1000 over 2000 N", "K2, 2.4 over 1.0 bar", "C, cross-ply over radial-ply")
_FREQUENCIES = (10.0, 17.0, 24.0)
#: A ratio beyond this is that of a C near its pole, where K'' is nearly zero.
_POLE = 3.0


@cache
def ratios(fault: pt.Fault) -> tuple[tuple[float, ...], ...]:
    """The ratios that a fault makes, a row for each of `_RATIOS`; not-a-number near a pole.

    The arms of the tyres do not depend on pressure and preload, so that each ratio is 1 without a fault.
    """
    low, middle, high = pt.PRESSURES
    light, heavy = pt.PRELOADS
    columns = []
    for frequency in _FREQUENCIES:
        k2, c = pt.over_conditions("radial-ply", fault, frequency)
        _, of_cross = pt.over_conditions("cross-ply", fault, frequency)
        pairs = (
            (c[high, light], c[low, light]),
            (c[high, light], c[high, heavy]),
            (k2[high, light], k2[low, light]),
            (of_cross[middle, light] / pt.STIFFER, c[middle, light]),
        )
        found = [over / under if min(over, under) > 0 else np.nan for over, under in pairs]
        columns.append([one if 1 / _POLE < one < _POLE else np.nan for one in found])
    return tuple(zip(*columns, strict=True))


def over_pressure() -> str:
    """Ratios over pressure, preload and tyre that a fault makes of tyres whose arms do not depend on them."""
    rows = []
    for fault in pt.FAULTS:
        cells = (", ".join("–" if one != one else f"{one:.2f}" for one in row) for row in ratios(fault))
        rows.append([f"{fault.name}: {size(fault, fault.size)}", *cells])
    return table(["what is off", *_RATIOS], rows)


def span(which: int, *frequencies: float) -> str:
    """The least and the largest ratio that any fault makes, at some frequencies."""
    at = [_FREQUENCIES.index(one) for one in frequencies]
    found = [ratios(fault)[which][i] for fault in pt.FAULTS for i in at]
    return f"{np.nanmin(found):.2f} to {np.nanmax(found):.2f}"


#: The twelve claims, one to a paragraph: what is claimed; whether it survives; why. Names in braces are computed.
_CLAIMS = """
1. K1 of the cross-ply is the larger; yes; Static test, none of eqs (8) to (14). Both tyres need one rate: a
loop of 20 s per branch alone makes K1 of the page's tyre {loop} % larger than at rest.

2. The cross-ply's curve is bent, the radial-ply's nearly straight; yes; Static test. An error of scale of load
or deflection bends no curve.

3. C of the cross-ply has a maximum at 1.7; open; A fault changes C over the pressures by a factor of {c_low} at
10 Hz, {c_high} from 17 Hz. A fault that is the same at all pressures makes a maximum in the middle in {maxima}
of {cases} cases. The size of the paper's maximum is not known.

4. C of the radial-ply rises with pressure; if the rise is larger; The same factors: {c_low} at 10 Hz, {c_high}
from 17 Hz.

5. C is higher under the low preload, at high pressure; if the difference is larger; A fault makes C at 1000 N
{load_low} times that at 2000 N at 10 Hz, {load_high} times from 17 Hz.

6. C of the radial-ply rises with frequency; no; It can only fall in a linear, relaxing tyre, with any constant
K1. Something else is in the numbers.

7. C of the cross-ply is the larger; if the ratio is larger; A fault changes the ratio of the two tyres by
{ratio_low} at 10 Hz, {ratio_high} from 17 Hz.

8. K2 of the radial-ply rises with pressure above 19 Hz, not at 16 to 19 Hz, and falls below; the rise if it is
larger, the fall not; A fault makes K2 at 2.4 bar {k2_low} times that at 1.0 bar at 10 Hz, {k2_high} times at 24
Hz. {fading} of the {count} faults make a fall at 10 Hz of a K2 without pressure, which fades upwards.

9. K2 of the radial-ply rises with frequency; yes, the amount not; A passive tyre with K1 not above K* at rest
has it. The true rise is {true}; 1 kg of tyre that is not counted makes it {uncounted}. {falling} of the {count}
faults make the line through K2 fall.

10. K2 of the cross-ply behaves likewise, at a higher level; as 7, 8 and 9; For the same reasons.

11. Below 18 Hz TR of the cross-ply is the lower, above it that of the radial-ply; yes; TR is measured, V2 over
V1, without force, m, K3 and K1. An error of the gains changes both tyres by one factor, and the frequency where
the curves cross not at all.

12. The resonance of the radial-ply is the lower; yes; It is the frequency of the largest measured TR. A gain
error moves no maximum.
"""


def claims() -> str:
    """The twelve claims of the paper, and which of them survive."""
    named = {fault.name: fault for fault in pt.FAULTS}
    true, _ = pt.example()
    uncounted, _ = pt.example(named["tyre's part moves with m, not counted"])
    loop = next(one for one in pt.FAULTS if one.unit == "s")
    text = _CLAIMS.format(
        loop=f"{100 * (loop.factor(loop.size) - 1):.0f}",
        **{f"{name}_low": span(at, 10.0) for at, name in enumerate(("c", "load", "k2", "ratio"))},
        **{f"{name}_high": span(at, 17.0, 24.0) for at, name in enumerate(("c", "load"))},
        k2_high=span(2, 24.0),
        ratio_high=span(3, 17.0, 24.0),
        maxima=_maxima(),
        cases=len(pt.FAULTS) * len(_FREQUENCIES),
        fading=_fading(),
        count=len(pt.FAULTS),
        true=f"{true[0] / 1e3:.0f} to {true[-1] / 1e3:.0f} kN/m",
        uncounted=f"{uncounted[0] / 1e3:.0f} to {uncounted[-1] / 1e3:.0f} kN/m",
        falling=sum(pt.slope(pt.example(fault)[0]) < 0 for fault in pt.FAULTS),
    )
    rows = (" ".join(one.split()).split("; ", 2) for one in text.strip().split("\n\n"))
    return table(["claim", "survives", "why"], rows)


def _fading() -> int:
    """Faults that make K2 fall with pressure at the lowest frequency by 1 % more than at the highest."""
    return sum(ratios(fault)[2][0] < min(0.99, ratios(fault)[2][-1] - 0.01) for fault in pt.FAULTS)


def _maxima() -> int:
    """Cases of `ratios` in which C of the cross-ply tyre at the middle pressure is above both others by 0.5 %."""
    found = 0
    for fault in pt.FAULTS:
        for frequency in _FREQUENCIES:
            _, c = pt.over_conditions("cross-ply", fault, frequency)
            low, middle, high = (c[pressure, pt.PRELOADS[0]] for pressure in pt.PRESSURES)
            found += min(low, middle, high) > 0 and middle > 1.005 * max(low, high)
    return found


#: How the table of components writes a size: SI unit -> its factor and the unit.
_SHOWN_UNITS = {"1": (100.0, " %"), "rad": (180 / np.pi, "°"), "s": (1e6, " µs"), "Hz": (1.0, " Hz")}
#: A shape in symbols; what is no error of a channel has words.
_SHAPES = {
    Shape.MODULUS: "$1$",
    Shape.ANGLE: "$j$",
    Shape.DELAY: "$-j\\omega$",
    Shape.LOW_CUT: "$j/f$",
    Shape.SLOPE: "$f^2$",
}


def components() -> str:
    """The components of the likelihood, with their sizes where nothing is stated; the page has belts in words."""
    rows = []
    for row in COMPONENTS:
        if row.group == "belt":
            continue
        factor, unit = _SHOWN_UNITS[row.unit]
        std, bound = (f"{float(f'{factor * size:.3g}'):g}{unit}" for size in (row.std, row.bound))
        words = row.words.replace("|K*|", r"$\lvert K^*\rvert$").replace("K*", "$K^*$")
        shape, key = _SHAPES.get(row.shape, row.shape.value), f"`{row.key}`" if row.key else "none"
        rows.append([words, shape, row.scope.value, std if row.std else "absent", bound, key])
    return table(["component", "shape", "scope", "not stated", "bound", "key"], rows)


#: Each table: its name, its page, and the function that makes it.
TABLES: dict[str, tuple[str, Callable[[], str]]] = {
    "c-by-fault": ("paper-could-not-see.md", c_by_fault),
    "k2-by-fault": ("paper-could-not-see.md", k2_by_fault),
    "where-it-turns": ("paper-could-not-see.md", where_it_turns),
    "of-random-tyres": ("paper-could-not-see.md", of_random_tyres),
    "over-pressure": ("paper-could-not-see.md", over_pressure),
    "claims": ("paper-could-not-see.md", claims),
    "components": ("theory/joint-likelihood.md", components),
}


def written(name: str) -> tuple[Path, str]:
    """The page of a table, and its text with the table as it is made now."""
    place, make = TABLES[name]
    page = DOCS / place
    marks = re.compile(rf"(<!-- begin: {name}, made -->\n).*?(\n<!-- end: {name} -->)", re.DOTALL)
    text, count = marks.subn(lambda found: f"{found[1]}\n{make()}\n{found[2]}", page.read_text(encoding="utf-8"))
    if count != 1:
        raise ValueError(f"{place} has the marks of the table {name} {count} times: once is wanted")
    return page, text
