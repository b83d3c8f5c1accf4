"""Sources of error in words: the name of each in a table with its unit and inside a sentence; its cheapest remedy."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from fourpole.core.sources import Kind, Role, Source
from fourpole.quantities import RIG_VALUES, ShownUnits
from fourpole.report.words.phrases import SENTENCES

#: Parts of a rig that are not stated: name inside a sentence, name in a table, SI unit, unit shown and its SI value.
_UNSTATED: dict[str, tuple[str, str, str, str, float]] = SENTENCES["unstated"]
#: Name of each kind of source inside a sentence, and its remedy before rig and tests are considered.
_WORDS: dict[Kind, tuple[str, str]] = {Kind[name]: texts for name, texts in SENTENCES["sources"].items()}


@dataclass(frozen=True)
class About:
    """Facts of one rig on which the choice of a remedy depends.

    Attributes
    ----------
    joint, massed, with_v2, blocked : bool
        Whether the joint route was used, an added mass was used, V2 was measured, the far side is blocked.
    fits, scatter : bool
        Whether rig and channels as stated fit their tests; whether K* of repeated tests scatters beyond the noise.
    candidate : str
        The unstated part that would explain a misfit best, in words; empty where there is none.
    """

    joint: bool
    massed: bool
    with_v2: bool
    fits: bool
    scatter: bool
    candidate: str
    blocked: bool = False


_BY_MASS = (
    "repeat one condition with a weighed mass added and use the joint route, which makes calibrated sensors "
    "unnecessary, or "
)
#: Errors of channels that no mass calibrates.
_NOBODY_STATES = (Kind.CROSSTALK, Kind.FIXTURE, Kind.GAIN_DRIFT, Kind.GAIN_STEP)
#: Errors of channels that change with frequency; a key takes them off sooner than more tests with a mass.
_OVER_FREQUENCY = (Kind.DELAY, Kind.LOW_CUT, Kind.SLOPE)
#: Kinds of source that a mass makes needless to calibrate.
_CALIBRATED = (Kind.GAIN, Kind.PHASE, Kind.DELAY, Kind.RESPONSE_GAIN, Kind.RESPONSE_PHASE)
#: Name in a table and unit shown of each kind that needs no more, and SI values of these units other than 1.
_SHOWN: dict[Kind, tuple[str, str]] = {Kind[name]: texts for name, texts in SENTENCES["shown"].items()}
_SI = {"%": 0.01, "°": pi / 180, "ms": 1e-3}


def source_in_words(source: Source) -> str:
    """The name of a source inside a sentence.

    Examples
    --------
    >>> source_in_words(Source(Kind.GAIN, "F1")), source_in_words(Source(Kind.RIG_VALUE, "moving_mass"))
    ("F1's gain", 'the moving mass m')
    """
    return _filled(_WORDS[source.kind][0], source)


def _filled(template: str, source: Source) -> str:
    value = RIG_VALUES[source.of] if source.kind is Kind.RIG_VALUE else None
    measure = "weigh it" if value and value.unit == "kg" else "measure it by itself"
    if source.of == "preload_damping":
        measure = "measure it by the decay of the rig without a specimen (preload_damping)"
    name = _UNSTATED[source.of][0] if source.kind is Kind.UNSTATED else value.name if value else source.text
    return template.format(
        channel=f"{source.of} against {source.under}" if source.under else source.of,
        name=(source.of or "the specimen") if source.role is Role.SPECIMEN else name,
        measure=measure,
    )


def remedy_of(source: Source) -> str:
    """The remedy of a source before rig and tests are considered."""
    return _filled(_WORDS[source.kind][1], source)


def remedy(source: Source, about: About) -> str:
    """The cheapest remedy of a source."""
    text = remedy_of(source)
    if source.kind is Kind.RIG_MISFIT or (source.kind is Kind.NOISE and not about.fits):
        best = f"resolve the misfit first; the best candidate is {about.candidate}"
        return best if about.candidate else _WORDS[Kind.RIG_MISFIT][1]
    if source.kind is Kind.NOISE and about.scatter:
        return "steady temperature, conditioning and amplitude, then repeat: the scatter of repeats counts as noise"
    if source.role is Role.RIG:
        return _rig_remedy(text, about)
    if source.role is Role.CHANNEL and about.massed and source.kind not in _NOBODY_STATES:
        if not about.joint:
            return "use the joint route: with the weighed mass it needs no calibrated sensor"
        by_mass = "repeat the tests with the weighed mass, or record them longer: the mass calibrates the channels"
        return text if source.kind in _OVER_FREQUENCY else by_mass
    if about.blocked or source.kind not in _CALIBRATED:
        return text
    return f"{'' if about.with_v2 else 'measure V2 too, '}{_BY_MASS}{text}"


def _rig_remedy(text: str, about: About) -> str:
    if about.joint:
        return text if about.massed else f"{text}, or repeat one condition with a weighed mass added"
    if about.with_v2:
        return f"use the joint route, which finds it from V2, or {text}"
    return f"{text}, or measure V2 too and use the joint route"


def in_words(source: Source, unit: str = "", units: ShownUnits | None = None) -> tuple[str, str, float, float]:
    """Name, unit shown, SI value of that unit, and the SI value shown as zero, in the units that are wanted.

    Examples
    --------
    >>> in_words(Source(Kind.RIG_VALUE, "preload_stiffness"), "N/m")
    ('preload spring K3', 'kN/m', 1000.0, 0.0)
    >>> in_words(Source(Kind.GAIN, "V1"), "1"), in_words(Source(Kind.GAIN, "F1", "V1"), "1")[0]
    (('gain of V1', '%', 0.01, 1.0), 'gain of F1 over V1')
    """
    of, under = source.of, source.under
    if source.kind is Kind.UNSTATED:
        _, name, unit, shown, scale = _UNSTATED[of]
        return name, *(units or ShownUnits()).wanted.get(unit, (shown, scale)), 0.0
    if source.kind is Kind.RIG_VALUE:
        value = (units or ShownUnits()).of(RIG_VALUES[of])
        return value.name, value.suffix, value.scale, 0.0
    if source.kind in _SHOWN:
        name, shown = _SHOWN[source.kind]
        gain = source.kind is Kind.GAIN
        what = f"{of} {'over' if gain else 'less'} {under}" if under else of or "the specimen"
        return name.format(what), shown, _SI.get(shown, 1.0), float(gain)
    return source.text.replace("_", " "), "" if unit == "1" else unit, 1.0, 0.0
