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
#: Name, unit shown and its SI value of errors that are 0 where there is none.
_SIMPLE = {
    Kind.CROSSTALK: ("cross-talk of {}", "%", 0.01),
    Kind.FIXTURE: ("compliance between {} and the specimen, over the specimen's", "%", 0.01),
    Kind.GAIN_DRIFT: ("drift of {}'s gain over the run", "%", 0.01),
    Kind.DRIFT: ("drift of K* of {} over the run", "%", 0.01),
    Kind.ANGLE_DRIFT: ("drift of the loss angle of {} over the run", "°", pi / 180),
    Kind.STEP: ("step of K* of {} during the run", "%", 0.01),
    Kind.ANGLE_STEP: ("step of the loss angle of {} during the run", "°", pi / 180),
    Kind.BELT_MASS: ("mass of {} between its ends", "kg", 1.0),
    Kind.BELT_SHARE: ("logarithm of the share of the springs of {}", "", 1.0),
    Kind.BELT_ANGLE: ("difference of the loss angles of the springs of {}", "°", pi / 180),
    Kind.BELT_EXPONENT: ("exponent of the share of the springs of {}", "", 1.0),
    Kind.AMPLITUDE: ("change of K* with the amplitude of the deflection", "", 1.0),
    Kind.DELAY: ("delay of {}", "ms", 1e-3),
    Kind.LOW_CUT: ("low-cut of {}", "Hz", 1.0),
    Kind.GAIN_STEP: ("step of {}'s gain during the run", "%", 0.01),
    Kind.SLOPE: ("rise of {}'s gain with frequency", "%", 0.01),
    Kind.MOUNTING_GAIN: ("gain of {} in one mounting", "%", 0.01),
    Kind.MOUNTING_PHASE: ("phase of {} in one mounting", "°", pi / 180),
    Kind.REMOUNTING_GAIN: ("gain of {} with one added mass", "%", 0.01),
    Kind.REMOUNTING_PHASE: ("phase of {} with one added mass", "°", pi / 180),
    Kind.BLOCK: ("change of |K*| of {} with the added mass", "%", 0.01),
    Kind.ANGLE_BLOCK: ("change of the loss angle of {} with the added mass", "°", pi / 180),
}


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
    if source.kind in _SIMPLE:
        name, shown, scale = _SIMPLE[source.kind]
        return name.format(of or "the specimen"), shown, scale, 0.0
    match source.kind:
        case Kind.UNSTATED:
            _, name, unit, shown, scale = _UNSTATED[of]
            shown, scale = (units or ShownUnits()).wanted.get(unit, (shown, scale))
            return name, shown, scale, 0.0
        case Kind.RIG_VALUE:
            value = (units or ShownUnits()).of(RIG_VALUES[of])
            return value.name, value.suffix, value.scale, 0.0
        case Kind.GAIN:
            return f"gain of {of} over {under}" if under else f"gain of {of}", "%", 0.01, 1.0
        case Kind.PHASE:
            return f"phase of {of} less {under}" if under else f"phase of {of}", "°", pi / 180, 0.0
        case Kind.RESPONSE_GAIN | Kind.RESPONSE_PHASE:
            what = "gain" if source.kind is Kind.RESPONSE_GAIN else "phase"
            return f"calibrated response of {of}, {what}, in its u", "", 1.0, 0.0
    return source.text.replace("_", " "), "" if unit == "1" else unit, 1.0, 0.0
