"""The sentences of checks and causes, from `words.toml` and from values of the core; words that people use, as data."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum
from functools import cache
from importlib import resources
from math import degrees, isfinite, nan
from typing import TYPE_CHECKING, Any, NamedTuple

from fourpole.core.checks import Check, Code, NoK1, Verdict
from fourpole.core.confidence import COVERAGE
from fourpole.errors import Message
from fourpole.quantities import ShownUnits

if TYPE_CHECKING:
    from fourpole.core.joint.misfit import Candidate

#: Values that say which case of a check it is: codes, and the quantity that it names.
CASES = ("error", "because", "looks", "branch", "name", "difficulty", "form", "steep")


def package_toml(package: str, name: str = "words.toml") -> dict[str, Any]:
    """What a TOML file of a package states: sentences, captions or looks; the file says what each is."""
    return tomllib.loads(resources.files(package).joinpath(name).read_text(encoding="utf-8"))


@cache
def _texts() -> dict[str, dict[str, Any]]:
    """The texts of words.toml, which is read when the first sentence is made."""
    return package_toml(__name__)


@cache
def vocabulary() -> dict[str, Any]:
    """Words by which people name channels, recordings and columns of tables: vocabulary.toml."""
    return package_toml(__name__, "vocabulary.toml")


@cache
def units() -> dict[str, str]:
    """Units of the values of checks by name; other values are ratios, counts, names or enums."""
    return {name: unit for unit, names in _texts()["units"].items() for name in names}


def _say(group: str, key: str | Enum, /, **values: object) -> str:
    """A text of words.toml with its values; an enum stands for the text of its name."""
    text: str = _texts()[group][key.name.lower() if isinstance(key, Enum) else key]
    return text.format(**values)


def template(code: Code, part: str, case: str = "") -> str:
    """What a check is `about`, or its `short` form, `cause` or `remedy` in a case; empty if it has none.

    The case is a verdict, or the `form` among the values of the check.
    """
    texts = _texts()["checks"][code.text]
    return str(texts.get(case, {}).get(part, texts.get(part, "")))


class Said(NamedTuple):
    """The sentence of a check in two parts; both are empty for a check that is plainly ok."""

    cause: str
    remedy: str


def said(check: Check) -> Said:
    """The sentence of a check.

    Examples
    --------
    >>> said(Check(Code.MEMORY, Verdict.REJECTED, values={"file": "D1.csv"}))
    Said(cause='D1.csv does not fit into memory: ', remedy='cut it with window [s]')
    """
    if check.verdict is Verdict.OK and not check.values:
        return Said("", "")
    known = {"statistic": check.statistic, "limit": check.limit, "channel": check.channel, **check.values}
    case = check.values.get("form") or (Verdict.REJECTED if check.values.get("at_first") else check.verdict)
    known["short"] = template(check.code, "short", case)
    known |= _FURTHER[check.code](check.values) if check.code in _FURTHER else {}
    cause, remedy = (template(check.code, part, case).format(**known) for part in ("cause", "remedy"))
    return Said(_say("parts", "at_first", cause=cause) if check.values.get("at_first") else cause, remedy)


def remark_of(check: Check) -> str:
    """The whole sentence of a check.

    Examples
    --------
    >>> remark_of(Check(Code.MEMORY, Verdict.REJECTED, values={"file": "D1.csv"}))
    'D1.csv does not fit into memory: cut it with window [s]'
    """
    return "".join(said(check))


def kind_of(*checks: Check) -> str:
    """What checks have in common that differ in numbers and names only."""
    plain = [(check, plain_values(check)) for check in checks]
    return repr([(check.code.text, check.channel, *(values.get(case) for case in CASES)) for check, values in plain])


def plain_values(check: Check) -> dict[str, Any]:
    """The values of a check as plain data for a file: numbers under their name with its unit, names, codes.

    Examples
    --------
    >>> from fourpole.core.checks import Branch
    >>> plain_values(Check(Code.K1_BRANCH, Verdict.WARNING, values={"branch": Branch.LOADING, "tests": ("S1",)}))
    {'branch': 'loading', 'tests': ['S1']}
    """
    values = check.values.items()
    return {f"{name} [{units()[name]}]" if name in units() else name: _plain(value) for name, value in values}


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.name.lower().replace("_", " ")
    if isinstance(value, Message):
        return [value.code, value.site]
    if isinstance(value, Check):
        return {"code": value.code.text, **plain_values(value)}
    if hasattr(value, "source"):  # a cause of a misfit
        return value.source.text
    if isinstance(value, tuple | list):
        return [_plain(part) for part in value]
    if isinstance(value, str | bool | int):
        return value
    number = float(value)
    return number if isfinite(number) else None


def cause_words(cause: Candidate) -> str:
    """A candidate for the cause of a misfit in words, with its size.

    Examples
    --------
    >>> from fourpole.core.joint.misfit import Candidate
    >>> from fourpole.core.sources import Kind, Source
    >>> gain = {"of": "F1", "percent": 4.5}
    >>> cause_words(Candidate("sensor F1", 0.045, 0.001, "1", 20.0, Source(Kind.GAIN, "F1"), 0.045, "gain", gain))
    'a gain of F1 off by +4.5 %'
    """
    values = dict(cause.values)
    values["kilo"] = values.get("size", 0.0) / 1e3
    if "stated" in values:
        unit, scale = ShownUnits().unit(values["unit"])
        values |= {
            "value": values["value"] / scale,
            "unit": unit,
            "stated": f"{values['stated'] / scale:.5g} {unit}".strip(),
        }
        values |= {"name": cause.name, "article": "an" if cause.name[0] in "aeiou" else "a"}
    if "turned" in values:
        values["turned"] = _say("parts", "turned") if values["turned"] else ""
    if "code" in values:
        channel = f"{values['channel']}: " if values["channel"] else ""
        values["shown"] = channel + template(values["code"], "short")
    return _say("causes", cause.form, **values)


def explained(causes: Iterable[Candidate]) -> str:
    """What explains a misfit, in words; causes that explain it equally well stand together."""
    named = ", or ".join(map(cause_words, causes))
    return _say("parts", "explained", causes=named) if named else _say("parts", "no_cause")


def first_of(names: Sequence[str], most: int, between: str = ", ") -> str:
    """The first of some names, and how many more there are.

    Examples
    --------
    >>> first_of(["D1", "D2", "D3", "D4"], 2)
    'D1, D2 and 2 more'
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{between.join(names[:most])}{more}"


# ---- what the sentence of a code needs beside the values of its check

_Values = Mapping[str, Any]


def _and(names: Iterable[str]) -> str:
    return " and ".join(names)


def interval_words(low: float, high: float, unit: str) -> str:
    """An interval of probability `COVERAGE` by Monte Carlo."""
    form = "unlimited" if not isfinite(low) else "limited" if isfinite(high) else "no_upper_limit"
    unit, scale = ShownUnits().unit(unit)
    return _say("interval", form, low=low / scale, high=high / scale, unit=unit, percent=100 * COVERAGE)


def _halves(values: _Values) -> dict[str, str]:
    change, causes = "", _say("halves", "gain_remedy")
    if "phase" in values:
        change = _say("halves", "phase", degrees=degrees(values["phase"]), ppm=values["ppm"])
        causes = _say("halves", "phase_remedy")
    elif "gain" in values:
        change = _say("halves", "gain", percent=100 * values["gain"])
    specimen = _say("halves", "specimen") if values["specimen"] else ""
    return {"change": change, "others": _and(values["others"]), "causes": causes + specimen}


def _consistency(values: _Values) -> dict[str, str]:
    looks = " or ".join(_say("looks", look) for look in values["looks"])
    return {"looks": f"; {looks}" if looks else ""}


def _cut(values: _Values) -> dict[str, str]:
    return {"cut": _and(_say("cut", end, seconds=values[end]) for end in ("before", "after") if values[end] > 0)}


def _because(values: _Values) -> dict[str, str]:
    because = values["because"]
    return {"why": remark_of(because) if isinstance(because, Check) else str(because)}


def _k1(values: _Values) -> dict[str, str]:
    """Values that only one side states, then the doubts about static tests."""
    doubts = [(name, [remark_of(check) for check in checks]) for name, checks in values["doubts"]]
    if values["sides"]:
        sides = [_say("k1", "side", axis=axis, side=_say("k1", side)) for axis, side in values["sides"]]
        doubts.insert(0, (", ".join(values["tests"]), sides))
    return {"why": "; ".join(_say("k1", "doubt", tests=tests, doubts="; ".join(texts)) for tests, texts in doubts)}


def _k1_temperature(values: _Values) -> dict[str, str]:
    side = "below" if values["there"] < values["own"] else "above"
    return {"names": ", ".join(values["tests"]), "side": _say("k1", side)}


def _k1_branch(values: _Values) -> dict[str, str]:
    subject = "of_tests" if values["tests"] else "of_none"
    return {"said": _say("k1", subject, tests=", ".join(values["tests"]), branch=_say("k1", values["branch"]))}


def why_no_k1(values: _Values) -> dict[str, str]:
    """Why a dynamic test has no K1, and the remedy."""
    known = dict(values)
    if values["because"] is NoK1.NO_TEST:
        bars = ", ".join(_say("no_k1", "bar", bar=pressure / 1e5) for pressure in values["pressures"])
        known["elsewhere"] = _say("no_k1", "elsewhere", bars=bars) if bars else ""
        known["state"] = ", ".join([_say("no_k1", "this_pressure"), *values["axes"]])
    elif values["because"] is NoK1.REJECTED:
        sentences = [said(check) for check in values["checks"]]
        known["causes"] = "; ".join(dict.fromkeys(sentence.cause.rstrip(":; ") for sentence in sentences))
        known["remedies"] = " or ".join(dict.fromkeys(sentence.remedy for sentence in sentences if sentence.remedy))
    case = values["because"].name.lower()
    return {part: _say("no_k1", f"{case}_{part}", **known) for part in ("why", "remedy")}


def _passive_arm(values: _Values) -> dict[str, str]:
    if "because" in values:
        stiffness = complex(values["storage"], values["loss_modulus"])
        why, remedy = values["because"].says(stiffness, values.get("k1", nan))
        return {"why": why, "remedy": remedy}
    return {"interval": interval_words(values["low K2"], values["high K2"], "N/m")}


def _amplitudes(values: _Values) -> dict[str, Any]:
    """The added masses of both tests, and words on them where they differ."""
    masses = dict(zip(("light", "heavy"), values.get("masses", ()), strict=False))
    return {**masses, "added": _say("parts", "added", **masses) if len({*masses.values()}) > 1 else ""}


def _uncertainty(values: _Values) -> dict[str, str]:
    low, high = f"low {values['name']}", f"high {values['name']}"
    if low not in values:
        return {"interval": _say("interval", "not_symmetric")}
    return {"interval": interval_words(values[low], values[high], units()[low])}


def _blocking(values: _Values) -> dict[str, str]:
    case, known = values["difficulty"].name.lower(), {**values, "spring": values["spring"] / 1e3}
    return {part: _say("difficulty", f"{case}_{part}", **known) for part in ("why", "remedy")}


def _exchanged_k1(values: _Values) -> dict[str, str]:
    named = [
        _say("k1", "at_pressure", tyre=tyre, bar=pressure / 1e5) if pressure else tyre
        for tyre, pressure in values["statics"]
    ]
    return {"names": _and(named)}


#: What sentences need that is more than a value in a blank.
_FURTHER: dict[Code, Callable[[_Values], dict[str, Any]]] = {
    Code.RESONANCE: lambda values: {name: values[name] / 1e3 for name in ("spring", "inertia")},
    Code.HALVES: _halves,
    Code.SHARED: lambda values: {"pair": _and(values["pair"])},
    Code.CONSISTENCY: _consistency,
    Code.V1_SCALE: lambda values: {"looks": _say("looks", values["looks"])},
    Code.STEADY: _cut,
    Code.LEFT_OUT: _because,
    Code.CONSTANT: lambda values: {"why": values.get("error") or _say("parts", "nothing_moves")},
    Code.K1: _k1,
    Code.K1_TEMPERATURE: _k1_temperature,
    Code.K1_MIXED: lambda values: {"axes": _and(values["axes"])},
    Code.K1_BRANCH: _k1_branch,
    Code.NO_K1: why_no_k1,
    Code.PASSIVE: _passive_arm,
    Code.PASSIVE_ARM: _passive_arm,
    Code.UNCERTAINTY: _uncertainty,
    Code.BLOCKING: _blocking,
    Code.STEEP: lambda values: {"how": _say("steep", values["steep"])},
    Code.RIG: lambda values: {"causes": explained(values["causes"])},
    Code.K1_EXCHANGED: _exchanged_k1,
    Code.EXCITATIONS: lambda values: {
        side: _say("excitation", values[side][0], level=values[side][1]) for side in ("softer", "stiffer")
    },
    Code.AMPLITUDES: _amplitudes,
    Code.COPY: lambda values: {"others": _and(values["tests"])},
    Code.EXCHANGED: lambda values: {"names": _and(values["tests"])},
}
