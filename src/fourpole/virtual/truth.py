"""The statement of a virtual campaign, and the true values that differ from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from fourpole.virtual.bench import Bench
from fourpole.virtual.phasor_rig import CHANNELS, FAULTS
from fourpole.virtual.plan import Planned

STD_GAIN, STD_PHASE = 2e-4, float(np.deg2rad(0.01))
#: Stated values of the usual rig with their standard uncertainties [kg], [N/m], [N s/m].
_PLAIN_RIG = {"moving_mass": (15.0, 0.01), "preload_stiffness": (12440.0, 20.0), "preload_damping": (15.0, 0.5)}
FURTHER = ("tyre_mass", "frame_stiffness", "preload_loss_factor", "input_mass")
#: Channels of the static rig, which have a gain only.
_STATIC = ("F", "x")
_ERRORS = (*FAULTS, *(f"gain {channel}" for channel in _STATIC))
#: Relative standard uncertainty of a further part that is declared.
_FURTHER_STD = 0.02


@dataclass(frozen=True)
class Statement:
    """The content of campaign.toml about the rig and the accuracy of F1, V1 and V2.

    Parameters
    ----------
    rig : mapping of name to (value, std) [SI]
        Stated values of the rig with their standard uncertainties.
    std_gain, std_phase : float [1], [rad]
        Standard uncertainties of the gain and of the phase of each channel.
    clean : bool
        Whether all values are stated as exact.
    """

    rig: Mapping[str, tuple[float, float]]
    std_gain: float = STD_GAIN
    std_phase: float = STD_PHASE
    clean: bool = False


@dataclass(frozen=True)
class Truth:
    """True rig, and true errors of gain [1] and phase [rad] of each channel."""

    bench: Bench
    gain_errors: Mapping[str, float]
    phase_errors: Mapping[str, float]

    def bench_of(self, test: Planned) -> Bench:
        """The rig with the added mass of a test."""
        return replace(self.bench, mass=self.bench.mass + test.added_mass)


def state(
    *,
    clean: bool = False,
    sensors: tuple[float, float] = (STD_GAIN, STD_PHASE),
    rig_std: Mapping[str, float] | None = None,
    declared: Mapping[str, float] | None = None,
) -> Statement:
    """The statement of a campaign; see `simulate_campaign` for the arguments.

    Raises
    ------
    ValueError
        If a name is unknown or an uncertainty negative.

    Examples
    --------
    >>> state(declared={"tyre_mass": 0.8}).rig["tyre_mass"]
    (0.8, 0.016)
    """
    rig_std, declared = rig_std or {}, declared or {}
    _known("rig_std", rig_std, _PLAIN_RIG)
    _known("declared", declared, FURTHER)
    if min(*sensors, *rig_std.values()) < 0.0:
        raise ValueError("the uncertainties in sensors and rig_std must be zero or positive")
    if not all(0.0 < value < inf for value in declared.values()):
        raise ValueError("declared values must be positive and finite; leave out parts that the rig does not have")
    rig = {name: (value, rig_std.get(name, std)) for name, (value, std) in _PLAIN_RIG.items()}
    rig |= {name: (declared[name], _FURTHER_STD * declared[name]) for name in FURTHER if name in declared}
    return Statement(rig, *sensors, clean=clean)


def _known(where: str, given: Mapping[str, float], known: Sequence[str] | Mapping[str, object]) -> None:
    """Raise ValueError for a name that is not known."""
    for name in given:
        if name not in known:
            raise ValueError(f"{where} has {name!r}; it may have {', '.join(known)}")


def draw_truth(
    statement: Statement,
    rng: np.random.Generator,
    *,
    rig_error: Mapping[str, float] | None = None,
    undeclared: Mapping[str, float] | None = None,
) -> Truth:
    """True values drawn about the statement, within two standard uncertainties.

    `rng` gives the same numbers for every statement, so that campaigns which differ in one value have equal errors.

    Raises
    ------
    ValueError
        If a name is unknown, or an undeclared part is also stated.
    """
    rig_error, undeclared = rig_error or {}, undeclared or {}
    _known("rig_error", rig_error, statement.rig)
    unstated = [name for name in FURTHER if name not in statement.rig]
    _known("undeclared", undeclared, (*unstated, "leaf_friction", *_ERRORS))

    def near(stated: float, std: float) -> float:
        return stated if statement.clean else stated + std * float(np.clip(rng.standard_normal(), -2.0, 2.0))

    def of_rig(names: Sequence[str]) -> dict[str, float]:
        drawn = {name: near(*statement.rig.get(name, (0.0, 0.0))) for name in names}
        misstated = {name: statement.rig[name][0] * (1.0 + rig_error[name]) for name in names if name in rig_error}
        return {name: value for name, value in (drawn | misstated).items() if name in statement.rig}

    rig = of_rig(tuple(_PLAIN_RIG))
    gains = {channel: near(0.0, statement.std_gain) for channel in CHANNELS}
    gains |= {channel: near(0.0, STD_GAIN) for channel in _STATIC}
    phases = {channel: near(0.0, statement.std_phase) for channel in CHANNELS}
    rig["mass"] = rig.pop("moving_mass")
    rig |= of_rig(FURTHER)
    rig |= {name: value for name, value in undeclared.items() if name not in _ERRORS}
    for channel in (*CHANNELS, *_STATIC):
        gains[channel] = undeclared.get(f"gain {channel}", gains[channel])
    for channel in CHANNELS:
        phases[channel] = undeclared.get(f"phase {channel}", phases[channel])
    bench = Bench(**rig)  # type: ignore[arg-type] # all of them are numbers
    bench.check()
    return Truth(bench, gains, phases)
