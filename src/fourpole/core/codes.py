"""The code of each check: its name on disk, and its sentences."""

from __future__ import annotations

from enum import Enum


class Code(Enum):
    """The code of each check, with its words.

    The words are: the name on disk, the statistic, the cause in short, the cause in full, and the remedy. Those of the
    last three that differ for a rejection follow; {short} in a full cause stands for the short one.
    """

    FREQUENCY = (
        "stated frequency",
        "the frequency of the recording against the one in tests.csv",
        "the recording turns at another frequency than is stated",
        "the recording turns at {found:.5g} Hz, {stated:.5g} Hz is stated ({statistic:.1%} off): ",
        "correct the frequency in tests.csv, or check that this is the right file",
    )
    MISSING = (
        "missing samples",
        "the share of samples that are missing",
        "samples are missing",
        "{percent:.2g} % of the samples are missing and were left out of the fit; ",
        "look at the logger",
    )
    SPOILT = (
        "drop-outs",
        "the share of drop-outs and spikes among the samples of a channel",
        "a channel has drop-outs or spikes",
        (
            "{channel} has drop-outs or spikes: {percent:.2g} % of its samples stand still or lie far off the rest, "
            "and were left out of the fit; "
        ),
        "look at cable, plug and logger, and repeat the test",
    )
    HALVES = (
        "steady channel",
        "the change of a channel against the others between the halves, in its limits",
        "a channel drifts against the others",
        "{channel} changes by {change} against {others} from the first half of the recording to the second: ",
        "{causes}",
    )
    MEAN_FORCE = (
        "mean force",
        "the departure of the mean of F1 from the preload",
        "the mean of F1 is not the preload",
        "the mean of F1 is {mean:.4g} N, and {preload:.4g} N is stated as preload: ",
        "correct the preload in tests.csv, or set the zero of F1",
    )
    MAINS = (
        "mains",
        "the distance to a multiple of the mains frequency, in steps of one over the length of the recording",
        "hum of the mains cannot be separated from the excitation",
        "{hertz:.4g} Hz lies on a multiple of the mains frequency: hum cannot be separated from the excitation; ",
        "test half a hertz beside it",
    )
    DISTORTION = (
        "distortion",
        "harmonics of the displacement at the contact over the fundamental",
        "the motion at the contact is no clean sine",
        "harmonics of the displacement at the contact are {statistic:.0%} of the fundamental: ",
        "look at the cam, the contact and the frequency; the tyre may behave non-linearly",
    )
    LINEARITY = (
        "linearity of the specimen",
        "harmonics of F1 that a linear specimen does not give over the fundamental",
        "the specimen is not linear",
        (
            "the specimen is not linear: harmonics of F1 that the motion does not explain are {statistic:.0%} of the "
            "fundamental (friction, play, a bent force-deflection curve or lift-off); K*, K2 and C hold for this "
            "amplitude only: "
        ),
        "test at several amplitudes, and compare tests of equal deflection amplitude only",
    )
    FORCE_LINEARITY = (
        "linearity of F1",
        "harmonics of F1 that are in neither V1 nor V2 over the fundamental",
        "the channel of F1 is not linear",
        (
            "the channel of F1 is not linear: its harmonics are {statistic:.0%} of the fundamental, and neither V1 nor "
            "V2 has them (soft clipping, or a force cell with hysteresis); "
        ),
        "check the range of the amplifier and the force cell",
    )
    RIG_LINEARITY = (
        "linearity of the rig",
        "harmonics of V2 that F1 does not explain over the fundamental",
        "the rig, or the channel of V2, is not linear",
        (
            "the rig, or the channel of V2, is not linear: harmonics of V2 need {statistic:.1%} of the fundamental of "
            "F1 more than F1 has (friction of the guide, play, soft clipping, or a resonance of the rig there); "
        ),
        "look at the guide and the preload spring, and at the range of V2",
    )
    EXCITATION = (
        "excitation",
        "the uncertainty of an amplitude over the amplitude",
        "a channel hardly moves at the test frequency",
        "{channel} hardly moves at {hertz:.4g} Hz: the amplitude is known to {statistic:.0%} only; ",
        "check the sensor, its column and the excitation",
    )
    LINE = (
        "line",
        "the uncertainty of F1/V1 or V2/V1 at a line over its modulus",
        "a line of the spectrum is not well known",
        "F1/V1 or V2/V1 at {hertz:.4g} Hz is known to {percent:.2g} % only; ",
        "record longer, or excite more at this frequency",
    )
    BESIDE = (
        "beside a line",
        "whether a line has power of its own",
        "the power at a frequency is that of another frequency",
        "at {hertz:.4g} Hz the spectrum has no power but that of another frequency beside it; ",
        "excite all frequencies of the band, or test the frequency of the sine as a dynamic test",
    )
    CLOSURE = (
        "closure phase",
        "the mean square of the closure phase of F1, V1 and V2 over its variance",
        "the noise is not independent between the channels, or lines leak",
        (
            "the phases of the cross spectra of F1, V1 and V2 do not close: they miss by {times:.2g} standard "
            "uncertainties (segments of {length:.3g} s); uncertainties are enlarged by this factor; "
        ),
        "look for noise that the channels share (hum, a common ground, cross-talk), or record longer",
    )
    SHARED = (
        "shared noise",
        "the chi-square of the closure phases that a correlation of the noises of two channels explains",
        "the noises of two channels are correlated",
        (
            "the closure phases of all lines show that noises are correlated, most likely those of {pair} by "
            "{size:.2f} (u = {std:.2f}): cross spectra have an error of some {percent:.2g} %; "
        ),
        "look for hum, a common ground or cross-talk, or record the drive as [channels] drive",
    )
    POOLED = (
        "F1 against V2, all lines",
        "the chi-square of F1 over what V2 and the rig need, over its degrees of freedom",
        "F1 and V2 contradict each other over the band",
        "over all lines F1 departs by {percent:.2g} % from what V2 and the rig need{looks}: ",
        "look for an undeclared delay or filter, a wrong gain of F1 or V2, or parts of the rig that are not stated",
    )
    RESIDUAL = (
        "residual",
        "the residual of the fit of a channel over the fundamental",
        "noise or an unsteady speed",
        (
            "the residual of the fit of {channel} is {statistic:.0%} of the fundamental: noise, an unsteady speed, "
            "or loose parts; "
        ),
        "look at the signal, record longer, or steady the drive",
    )
    LIFT_OFF = (
        "lift-off",
        "the dynamic force over the preload",
        "the tyre is close to lifting off",
        "the dynamic force reaches {peak:.4g} N, {statistic:.0%} of the preload of {preload:.4g} N: {short}; ",
        "test with a higher preload or a smaller excitation, or state fixed = true for a specimen held on both sides",
        "the tyre lifts off",
    )
    RESONANCE = (
        "rig resonance",
        "the largest part of the rig's stiffness over K3 - m w²",
        "K* is poorly determined near the rig's own resonance",
        (
            "{hertz:.4g} Hz is the rig's own resonance (K3 = {spring:.4g} N/m, m w² = {inertia:.4g} N/m): it moves "
            "almost without force, so K* is poorly determined; "
        ),
        "test at another frequency, or with another moving mass",
    )
    CONSISTENCY = (
        "F1 against V2",
        "the departure of F1 from what V2 and the rig need",
        "F1 and V2 contradict each other",
        "F1 is {ratio:.3g} times, and {degrees:.0f} degrees off, what V2 and the rig need{looks}: ",
        "look for an inverted or wrongly scaled F1 or V2, an undeclared delay, or a wrong moving mass",
    )
    CLIPPING = (
        "clipping",
        "the share of samples at the end of the converter's range",
        "a channel is clipped",
        "{channel} is clipped: {statistic:.1%} of its samples stand at the end of its range; ",
        "set a larger range on the amplifier and repeat the test",
    )
    LEFT_OUT = (
        "use",
        "whether a channel that the route does not need can be used",
        "a channel was left out",
        "{channel} was left out: {why}",
    )
    TIME_BASE = ("time base", "the times of the samples", "the time base is doubtful", "{error}")
    STEADY = (
        "steady part",
        "the part of the recording in which the drive is steady",
        "the ends of the recording were cut",
        "{cut} of {length:.4g} s were cut, because the drive was not steady there; ",
        "state window [s] to choose",
    )
    SPEED = (
        "speed",
        "the wander of the drive's speed over its mean",
        "the speed of the drive wanders",
        (
            "the speed of the drive wanders by up to {statistic:.2%} of its mean: a fit at one frequency would change "
            "V1/F1 or V2/V1 by {shift:.2g} of it, so the fit follows the phase of V1; "
        ),
        "record a tacho or encoder and state it as [channels] reference",
    )
    STATEMENT = ("tests.csv", "the row of the test in tests.csv", "", "{error}")
    EXCLUDED = ("excluded", "whether the row of the test excludes it", "excluded by hand", "{error}")
    RECORDING = ("recording", "whether the recording can be read and used", "", "{error}")
    CONSTANT = ("constant channel", "whether a channel moves at all", "a channel is constant", "{why}")
    TOO_SHORT = ("length", "the cycles in the recording", "the recording is too short", "{error}")
    MEMORY = (
        "memory",
        "whether the recording fits into memory",
        "the recording does not fit into memory",
        "{file} does not fit into memory: ",
        "cut it with window [s]",
    )
    READER = (
        "reader",
        "whether the recording could be read at all, within the limit of memory",
        "a recording ended the process that read it",
        "{file} {error}; ",
        "the file may be damaged: copy or export it again, or cut it with window [s]",
    )
    SLOW = (
        "time",
        "whether the recording could be read within the limit of processor time, and without standing still",
        "a recording took longer to read than it may",
        "{file} {error}; ",
        "allow more with --time-limit, or cut it with window [s]",
    )
    FAULT = (
        "fault",
        "a fault of the program",
        "",
        "a fault in Fourpole itself ({error}); ",
        "please report it with this recording",
    )
    LOAD_CURVE = (
        "load curve",
        "whether the load-deflection curve can be read and used",
        "",
        "{error}; ",
        "correct or repeat the static test, or state K1 [N/m] in tests.csv",
    )
    CURVE = ("curve", "the form of the load-deflection curve", "", "{error}")
    BEYOND_CURVE = (
        "preload",
        "whether the load-deflection curve reaches the preload",
        "the load-deflection curve does not reach the preload",
        "{error}; ",
        "record the static test past the preload",
    )
    NO_PRELOAD = (
        "no preload",
        "whether a preload is known at which K1 can be read",
        "no preload is stated",
        "no dynamic test that takes this K1 states a preload: ",
        "state one in this row to get K1",
    )
    SECANT = ("secant", "whether the curve reaches the point of zero load", "there is no secant", "no secant: {error}")
    LOAD_ZERO = (
        "zero of the load",
        "the load of a static test before contact, over the span of the loads",
        "the load cell does not read zero without a load",
        "the load before contact is {without:.4g} N, {statistic:.1%} of the span, so K1 is that of another load: ",
        "zero the load cell, or state offset of the channel load in campaign.toml",
    )
    K1 = ("K1", "the static stiffness of a dynamic test", "K1 is doubtful", "{why}")
    K1_TEMPERATURE = (
        "K1 temperature",
        "the distance in temperature to the nearest static test [K]",
        "K1 is that of another temperature",
        "K1 is that of {names} at {there:.4g} °C, {statistic:.3g} K {side} this test: ",
        "add a static test at {own:.4g} °C",
    )
    K1_MIXED = (
        "K1 conditions",
        "whether the static tests of a dynamic test are of one condition",
        "K1 is the mean of static tests of several conditions",
        "K1 is the mean of static tests that differ in {axes}: ",
        "state that of this test, or make a static test at it",
    )
    K1_BRANCH = (
        "K1 of one branch",
        "whether K1 is the tangent of the mean of loading and unloading",
        "K1 is not the mean of loading and unloading",
        "{said}, and K2 and C refer to it: ",
        "record complete cycles of loading and unloading, or state K1 [N/m] in tests.csv",
    )
    NO_K1 = (
        "no K1",
        "whether there is a static stiffness",
        "there is no K1, so K2 and C are blank",
        "K2 and C are left blank: {why}: ",
        "{remedy}",
    )
    PASSIVE_ARM = (
        "passive arm",
        "the share of the Monte Carlo trials of K2 and C that is not passive",
        "K' lies too close to K1",
        "K2 and C are not identifiable: K' lies too close to K1 for its uncertainty; K2 is{interval}: ",
        "use K* instead",
        "no passive K2 and C exist",
        "{why}",
        "{remedy}",
    )
    UNCERTAINTY = (
        "uncertainty",
        "the relative uncertainty of K2 or C, the larger one",
        "the uncertainty of K2 or C is too large",
        "{name} is known to {statistic:.0%} only,{interval}: ",
        "use K* instead, or state the rig, K1 and the channels with smaller uncertainties",
    )
    AGREEMENT = (
        "agreement",
        "the factor by which the variance of a test was enlarged",
        "the test does not go with the other tests of its rig",
        (
            "does not go with the other tests of its rig: its residual is {times:.2g} times what its noise "
            "allows, so it hardly counts; "
        ),
        "look for a wrong load, mass, range or a loose sensor, and repeat it",
    )
    RELATIVE = (
        "joint against relative",
        "squared difference between K* of the joint and of the relative route, over its variance",
        "the joint and the relative route do not agree",
        (
            "K' of the relative route, which needs no rig, is {percent:+.2g} % off that of the joint one, beyond what "
            "noise explains: "
        ),
        "look for a difference from the other tests: a range, a mass, a loose sensor, another tyre",
    )
    RIG = (
        "rig",
        "chi-square of the rig as stated over its degrees of freedom",
        "the rig as stated does not fit its tests",
        "the rig and channels as stated do not fit their tests ({causes}): ",
        "find the cause, state it, and analyse again",
    )
    SCATTER = (
        "scatter",
        "the relative scatter of K* between tests of one condition",
        "K* repeats badly",
        "K* of tests of one condition scatters by {statistic:.1%}, where tyres repeat to 1 % and better: ",
        "look for exchanged labels, another amplitude, temperature or pressure, and a sensor that depends on the mass",
    )
    DRIFT_BY_MASS = (
        "drift with the mass",
        "the drift of K* over the run, where it goes with the added mass",
        "K* changes with the added mass, by a drift or by a sensor",
        (
            "K* with the added mass departs from K* without it, as a drift of {statistic:.1%} over the run makes it; "
            "an error of a sensor looks alike: "
        ),
        "repeat some tests without the mass after those with it",
    )
    V1_SCALE = (
        "V1 against K1",
        "K' over K1 as V1 is stated",
        "V1 looks wrongly scaled or inverted",
        "K' is {statistic:.3g} times K1, but a plausible multiple if V1 {looks}: ",
        "check the unit, sign and column of V1",
    )
    K1_RATIO = (
        "K1 against K'",
        "K' over K1",
        "K1 is far below K'",
        (
            "K1 looks too small: K' is {statistic:.3g} times K1, and a loss factor of {loss:.2g} explains {limit:.2g} "
            "times at most; "
        ),
        "check the static test: its specimen, unit of load (kgf, kN) and deflection",
    )
    K1_LARGE = (
        "K1 above K'",
        "K' over K1",
        "K1 is above K'",
        ("K1 looks too large: it is {times:.3g} times K' of this test; K' of a passive specimen is not below its K1; "),
        "check the static test: its specimen, unit of load (kgf, kN) and deflection",
    )
    K1_EXCHANGED = (
        "K1 exchanged",
        "the difference of (K' - K1)/K'' between two tyres or pressures over its usual value",
        "two K1 look exchanged",
        (
            "K1 of {names} looks exchanged: (K' - K1)/K'' is {first:.2g} and {second:.2g} at equal conditions, and "
            "{usual:.2g} for both with the other's K1; "
        ),
        "check which static test is of which tyre and pressure",
    )
    AMPLITUDES = (
        "amplitudes",
        "the largest over the smallest deflection amplitude of a condition",
        "a curve mixes deflection amplitudes",
        "the curve of {name} mixes deflection amplitudes of {smallest:.3g} to {largest:.3g} mm: ",
        "compare K* of rubber at equal amplitudes only, or make the amplitude an axis of [conditions]",
    )
    EXCITATIONS = (
        "excitations",
        "the mean square of the differences of K* between two excitations over their variances",
        "K* depends on the excitation",
        (
            "K* of {name} by {stiffer} is {decibel:.2g} dB above that by {softer} (mean of {count} frequencies; a "
            "linear specimen has the same; ISO 10846-2 allows {linear:g} dB): "
        ),
        "compare K* at equal excitation only, or make the excitation an axis of [conditions]",
    )
    COPY = (
        "copy",
        "whether two tests have the same recording",
        "two tests have the same recording",
        "the recording is that of {others}, too: ",
        "name the right file of each test, or leave one out",
    )
    NOISE = (
        "noise",
        "the noise of a channel over that of the other tests",
        "a channel is noisier than in the other tests",
        "{channel} has {statistic:.2g} times the noise of the other tests: ",
        "look at the sensor and its cable",
    )
    OFF_CURVE = (
        "K* curve",
        "the squared distance from the smooth curve of K* of the other tests, over its variance",
        "K* does not lie on the curve of its condition",
        "does not go with the other tests of its condition: K* lies {percent:.2g} % off their smooth curve; ",
        "look for a wrong pressure, preload or range, or a loose sensor, and repeat it",
    )
    OTHER_CURVE = (
        "K* curve of another condition",
        "the squared distance from the smooth curve of K* of the other tests, over its variance",
        "K* lies on the curve of another condition",
        "K* lies {percent:.2g} % off the curve of its condition, and on the curve of {other}: ",
        "if its label is wrong, correct it in tests.csv, else repeat it",
    )
    EXCHANGED = (
        "labels",
        "the squared distance from the smooth curve of K* of the other tests, over its variance",
        "two labels look exchanged",
        "the labels of {names} look exchanged: K* of each lies on the curve of the other's condition; ",
        "exchange them in tests.csv, or repeat both",
    )
    CONVERGENCE = (
        "convergence",
        "whether the joint route converged",
        "the joint route did not converge",
        "the joint route did not converge for this rig: ",
        "use --route relative or mobility",
    )
    CALIBRATION = (
        "calibration",
        "a rigid mass in place of the tyre",
        "a rigid mass in place of the tyre",
        "a rigid mass of {mass:g} kg in place of the tyre: it serves the rig and the channels",
    )
    CALIBRATION_UNUSED = (
        "calibration unused",
        "whether the route uses a calibration test",
        "the route does not use a calibration test",
        "a calibration test serves the joint route only, not the {route} route",
    )

    def __init__(self, text: str, about: str, short: str, cause: str, remedy: str = "", *rejected: str) -> None:
        self.text, self.about = text, about
        words = (short, cause, remedy)
        self._words = {"warning": words, "rejected": (*rejected, *words[len(rejected) :])}

    @property
    def limit_is_least(self) -> bool:
        """Whether the limit is the least good statistic; it is the largest one of every other code."""
        return self in (Code.MAINS, Code.PASSIVE_ARM)

    def short(self, verdict: str) -> str:
        """Cause in a few words; empty if only the whole sentence gives the cause."""
        return self._words["rejected" if verdict == "rejected" else "warning"][0]

    def says(self, verdict: str) -> tuple[str, str]:
        """Templates of the cause and of the remedy; joined, they are the sentence of the check."""
        _, cause, remedy = self._words["rejected" if verdict == "rejected" else "warning"]
        return cause, remedy

    @classmethod
    def read(cls, text: str) -> Code | None:
        """The code with this name on disk; None if no code has it."""
        return next((code for code in cls if code.text == text), None)
