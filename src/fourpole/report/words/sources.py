"""Sources of error in words: the name of each in a table with its unit and inside a sentence; its cheapest remedy."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from fourpole.core.sources import Kind, Role, Source
from fourpole.quantities import RIG_VALUES, ShownUnits

#: Parts of a rig that are not stated: name inside a sentence, name in a table, SI unit, unit shown and its SI value.
_UNSTATED: dict[str, tuple[str, str, str, str, float]] = {
    "mass": ("a moving mass that is not stated", "moving mass that is not stated", "kg", "kg", 1.0),
    "spring": ("a spring that is not stated", "spring that is not stated", "N/m", "kN/m", 1e3),
    "frame": ("a compliant frame that is not stated", "compliance of the frame, not stated", "", "mm/kN", 1e-6),
    "loss": (
        "a loss factor of the preload spring that is not stated", "loss factor of the spring, not stated", "", "", 1.0,
    ),
    "friction": ("dry friction that is not stated", "dry friction that is not stated", "N", "N", 1.0),
    "input": ("an input mass that is not stated", "input mass that is not stated", "kg", "kg", 1.0),
}  # fmt: skip


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


#: {channel} is the channel, or one against another, {name} the rig's value, unstated part, specimen or text.
_WORDS = {
    Kind.NOISE: "the noise of the sensors",
    Kind.FREQUENCY: "the uncertainty of the frequency",
    Kind.RIG_MISFIT: "the misfit of the rig",
    Kind.GAIN: "{channel}'s gain",
    Kind.PHASE: "{channel}'s phase",
    Kind.DELAY: "{channel}'s delay",
    Kind.RESPONSE_GAIN: "the gain of {channel}'s calibrated response",
    Kind.RESPONSE_PHASE: "the phase of {channel}'s calibrated response",
    Kind.CROSSTALK: "the cross-talk of {channel}",
    Kind.GAIN_DRIFT: "the drift of {channel}'s gain",
    Kind.RIG_VALUE: "the {name}",
    Kind.UNSTATED: "{name}",
    Kind.ADDED_MASS: "the weight of the {name}",
    Kind.DRIFT: "the drift of {name} over the run",
    Kind.ANGLE_DRIFT: "the drift of the loss angle of {name} over the run",
    Kind.AMPLITUDE: "the amplitude of the deflection",
    Kind.K1: "K1",
    Kind.K1_FIT: "the fit of K1",
    Kind.K1_GAP: "the gap between the branches of K1",
    Kind.K1_CYCLES: "the change of K1 from cycle to cycle",
    Kind.K1_ZERO: "the zero of the load in K1",
    Kind.K1_GAINS: "the calibration of load and deflection in K1",
    Kind.K1_REPEATS: "the scatter of K1 between repeated static tests",
    Kind.K1_STATED: "K1 as stated",
    Kind.K1_DRIFT: "the drift of the specimen between its static and its dynamic test",
    Kind.K1_TEMPERATURE: "the temperature of the static test, which is not that of the dynamic test",
    Kind.OTHER: "{name}",
}
_BY_MASS = (
    "repeat one condition with a weighed mass added and use the joint route, which makes calibrated sensors "
    "unnecessary, or "
)
_STEADY = "condition the specimen longer and keep its temperature, until a repeat at the end of the run agrees"
_STATE_K1 = "state K1 with a smaller uncertainty, or add a static test"
#: Errors of channels that no mass calibrates.
_NOBODY_STATES = (Kind.CROSSTALK, Kind.GAIN_DRIFT)
#: The remedy of each kind of source, before the properties of rig and tests are considered.
_REMEDIES = {
    Kind.NOISE: "record longer or over more cycles: four times as many halve it",
    Kind.FREQUENCY: "record longer at a steady speed",
    Kind.RIG_MISFIT: "resolve the misfit first: look for a part of the rig that is not stated",
    Kind.GAIN: f"{_BY_MASS}calibrate the gain of {{channel}}",
    Kind.PHASE: f"{_BY_MASS}calibrate the phase of {{channel}}",
    Kind.DELAY: f"{_BY_MASS}measure the delay of {{channel}} and state it with a smaller uncertainty",
    Kind.RESPONSE_GAIN: f"{_BY_MASS}calibrate the response of {{channel}} with a smaller uncertainty",
    Kind.RESPONSE_PHASE: f"{_BY_MASS}calibrate the response of {{channel}} with a smaller uncertainty",
    Kind.CROSSTALK: "look for a cable, a ground or an amplifier that the two channels share",
    Kind.GAIN_DRIFT: "warm the amplifier of {channel} up, and calibrate it before and after the run",
    Kind.RIG_VALUE: "{measure} and state it with a smaller uncertainty",
    Kind.UNSTATED: "look for this part of the rig; remove it, or measure it and state it in campaign.toml",
    Kind.ADDED_MASS: "weigh the added mass on a better balance",
    Kind.DRIFT: _STEADY,
    Kind.ANGLE_DRIFT: _STEADY,
    Kind.AMPLITUDE: "test all frequencies at one amplitude of the deflection",
    Kind.K1: _STATE_K1,
    Kind.K1_FIT: "repeat the static test with finer steps of load round the preload",
    Kind.K1_GAP: "use K' and K'', which need no K1; or state the K1 that you mean, with its uncertainty, in tests.csv "
    "(the gap is the rubber's own hysteresis, which no test closes)",
    Kind.K1_CYCLES: "repeat the static test with more cycles, until two follow each other closely",
    Kind.K1_ZERO: "warm up the load cell of the static rig, and zero it without load before the test",
    Kind.K1_GAINS: "calibrate the load and deflection channels of the static rig",
    Kind.K1_REPEATS: "look for what differs between the static tests (temperature, conditioning, seating, speed of "
    "loading), or repeat them more often: four times as many halve the uncertainty of their mean",
    Kind.K1_STATED: _STATE_K1,
    Kind.K1_TEMPERATURE: "make the static test at the temperature of the dynamic tests, or state in "
    "campaign.toml how much K* changes per kelvin",
    Kind.K1_DRIFT: "say in column time of tests.csv when each test was made, and make the static test in the middle of "
    "the run",
    Kind.OTHER: "state {name} with a smaller uncertainty",
}
#: Name, unit shown and its SI value of errors that are 0 where there is none.
_SIMPLE = {
    Kind.CROSSTALK: ("cross-talk of {}", "%", 0.01),
    Kind.GAIN_DRIFT: ("drift of {}'s gain over the run", "%", 0.01),
    Kind.DRIFT: ("drift of K* of {} over the run", "%", 0.01),
    Kind.ANGLE_DRIFT: ("drift of the loss angle of {} over the run", "°", pi / 180),
    Kind.AMPLITUDE: ("change of K* with the amplitude of the deflection", "", 1.0),
    Kind.DELAY: ("delay of {}", "ms", 1e-3),
}


def source_in_words(source: Source) -> str:
    """The name of a source inside a sentence.

    Examples
    --------
    >>> source_in_words(Source(Kind.GAIN, "F1")), source_in_words(Source(Kind.RIG_VALUE, "moving_mass"))
    ("F1's gain", 'the moving mass m')
    """
    return _filled(_WORDS[source.kind], source)


def _filled(template: str, source: Source) -> str:
    value = RIG_VALUES[source.of] if source.kind is Kind.RIG_VALUE else None
    name = _UNSTATED[source.of][0] if source.kind is Kind.UNSTATED else value.name if value else source.text
    return template.format(
        channel=f"{source.of} against {source.under}" if source.under else source.of,
        name=(source.of or "the specimen") if source.role is Role.SPECIMEN else name,
        measure="weigh it" if value and value.unit == "kg" else "measure it by itself",
    )


def remedy(source: Source, about: About) -> str:
    """The cheapest remedy of a source."""
    text = _filled(_REMEDIES[source.kind], source)
    if source.kind is Kind.RIG_MISFIT or (source.kind is Kind.NOISE and not about.fits):
        best = f"resolve the misfit first; the best candidate is {about.candidate}"
        return best if about.candidate else _REMEDIES[Kind.RIG_MISFIT]
    if source.kind is Kind.NOISE and about.scatter:
        return "steady temperature, conditioning and amplitude, then repeat: the scatter of repeats counts as noise"
    if source.role is Role.RIG:
        return _rig_remedy(text, about)
    if source.role is Role.CHANNEL and about.massed and source.kind not in _NOBODY_STATES:
        if about.joint:
            return "repeat the tests with the weighed mass, or record them longer: the mass calibrates the channels"
        return "use the joint route: with the weighed mass it needs no calibrated sensor"
    if about.blocked:
        return text.removeprefix(_BY_MASS)
    return text if about.with_v2 or not text.startswith(_BY_MASS) else f"measure V2 too, {text}"


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
