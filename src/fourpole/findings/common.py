"""The errors that two compared results have in common, and why."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import polars as pl

from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.sources import Kind, Role, Source
from fourpole.quantities import ADDED_MASS, RIG, RIG_VALUES, TYRE
from fourpole.study.record import section
from fourpole.study.study import Study

_STATIC_ROLES = ("load", "deflection")
#: Keys of a channel that have no effect on its calibration.
_NO_CALIBRATION = ("range",)


def none(_: str) -> bool:
    """No error is common."""
    return False


def of_one_campaign(results: Study, specimens: tuple[str, str]) -> tuple[str, ...]:
    """What two specimens of one campaign share, as sentences."""
    if not results.covariance.height:
        return ("The results have no covariance.parquet: errors that both specimens share are taken as independent.",)
    rigs = [set(results.dynamic.filter(pl.col(TYRE.head) == name)[RIG.head]) for name in specimens]
    if not rigs[0] & rigs[1]:
        return (f"{' and '.join(specimens)} were tested on different rigs: all errors of K* are taken as independent.",)
    text = (
        f"{' and '.join(specimens)} were tested in one campaign: the errors of its sensors, rig and weighed masses are "
        "common to both, with the covariance that the campaign found; in K1 the gains of load and deflection are."
    )
    return (text,)


def of_two_campaigns(first: Study, second: Study) -> tuple[Callable[[str], bool], tuple[str, ...]]:
    """Whether the error of a source is common, and the reasons as sentences: it is if both state the value alike."""
    one, two = first.record, second.record
    halls = [str(section(record, "stated").get("laboratory") or "") for record in (one, two)]
    if all(halls) and halls[0] != halls[1]:
        return none, (f"The laboratories differ ({halls[0]}, {halls[1]}): all errors are taken as independent.",)
    channels = {role: _alike(one, two, "channels", role) for role in (*CHANNELS, *_STATIC_ROLES)}
    rigs = [section(record, "stated", "rigs") for record in (one, two)]
    values = {
        name: all(name in section(rig) for each in rigs for rig in each.values())
        and len(_stated_values(rigs, name)) == 1
        for name in RIG_VALUES
    }
    by_symbol = {SYMBOLS[role]: channels[role] is True for role in CHANNELS}

    def common(text: str) -> bool:
        source = Source.read(text)
        if source.kind is Kind.K1_GAINS:
            return all(channels[role] is True for role in _STATIC_ROLES)
        if source.role in (Role.CHANNEL, Role.RATIO):
            names = [name for name in (*source.of.split(" in "), source.under) if name]
            return all(by_symbol.get(name, False) for name in names)
        if source.role is Role.RIG:
            return values.get(source.of, False)
        return source.role is Role.MASS

    return common, _reasons(channels, values, weighed=all(map(_weighs, (first, second))))


def _weighs(results: Study) -> bool:
    """Whether a test has an added mass."""
    table = results.dynamic
    return ADDED_MASS.head in table.columns and bool((table[ADDED_MASS.head].fill_null(0.0) > 0.0).any())


def _alike(one: dict[str, Any], two: dict[str, Any], *path: str) -> bool | None:
    """Whether both records state a channel alike; None if one of them does not have it."""
    both = [section(record, "stated", *path) for record in (one, two)]
    if not all(both):
        return None
    first, second = ({key: value for key, value in each.items() if key not in _NO_CALIBRATION} for each in both)
    return first == second


def _stated_values(rigs: Sequence[dict[str, Any]], name: str) -> set[tuple[Any, Any]]:
    return {(section(rig, name).get("value"), section(rig, name).get("std")) for each in rigs for rig in each.values()}


def _reasons(channels: dict[str, bool | None], values: dict[str, bool], *, weighed: bool) -> tuple[str, ...]:
    """What is common and what is not, as sentences."""
    words = {**SYMBOLS, "load": "load", "deflection": "deflection"}
    alike = [words[role] for role, same in channels.items() if same]
    other = [words[role] for role, same in channels.items() if same is False]
    rig = [RIG_VALUES[name].name for name, same in values.items() if same]
    said = []
    if alike or rig:
        parts = [f"the sensors of {', '.join(alike)}"] if alike else []
        parts += [f"of the rig {', '.join(rig)}"] if rig else []
        listed = "; ".join([*parts, *(["weighed masses of the same size"] if weighed else [])])
        said.append(
            f"Both campaigns state alike {listed}. Their errors are taken as common: they cancel as far as they act "
            "alike. If one of them was exchanged or calibrated again between the campaigns, use --independent."
        )
    if other:
        said.append(f"The statements of {', '.join(other)} differ: their errors are taken as independent.")
    return tuple(said) or ("The campaigns state nothing alike: all errors are taken as independent.",)
