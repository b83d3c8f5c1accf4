"""What the package computes for the reference cases, by calls.toml; what is more than a call stands here."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pkgutil import resolve_name
from typing import Any

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.chain import Geophone, HighPass, LowPass
from fourpole.core.phasor import Phasors
from fourpole.core.recording import Channel, Recording
from fourpole.report.html import packaged

#: The objects and functions of calls.toml, which says what they are.
_CALLS: dict[str, dict[str, Any]] = tomllib.loads(packaged("calls.toml", "fourpole.report.selftest"))
#: Links of a measuring chain by their names in the cases.
_LINKS = {"low pass": LowPass, "high pass": HighPass, "geophone": Geophone}


def calculated(case: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a case by name; one with "Re" and "Im" in the case is complex."""
    function, (family, _, word) = case["function"], case["function"].rpartition(" ")
    function = function if function in _CALLS["functions"] else family
    calls = _CALLS["functions"][function]
    known, values = _Known(case, word), dict[str, Any]()
    for names, call in calls.items() if isinstance(calls, dict) else [(calls[0], [function, *calls[1:]])]:
        result = known.result(call)
        known.setdefault(names, result)
        parts = [names.format(one) for one in known["symbols"]] if "{" in names else names.split(", ")
        values |= zip(parts, _flat(result), strict=False)
    return values


class _Known(dict[str, Any]):
    """Inputs of a case, values that were calculated, and objects of calls.toml, made when they are first needed."""

    def __init__(self, case: Mapping[str, Any], word: str) -> None:
        super().__init__({**case, **case["inputs"], "word": word})
        self.update({name: np.array(series) for name, series in case.get("series", {}).items()})
        self.update({name[3:]: self[name] + 1j * self[f"Im {name[3:]}"] for name in [*self] if name[:3] == "Re "})
        if "frequency" in self:
            self["omega"] = 2 * np.pi * self["frequency"]

    def __missing__(self, name: str) -> Any:
        self[name] = self.result(_CALLS["objects"][name])
        return self[name]

    def result(self, call: Any) -> Any:
        """The result of a call or an argument; calls.toml says what they are."""
        if isinstance(call, str):
            return call[1:] if call[:1] == "=" else self[call]
        if isinstance(call, dict):
            return {key: self.result(part) for key, part in call.items() if self._is_stated(part)}
        if not isinstance(call, list):
            return call
        path, *arguments = call
        named = {key: one for part in arguments if isinstance(part, dict) for key, one in self.result(part).items()}
        if path == "of":
            owner = self.result(arguments[0])
            found = [getattr(owner, name) for name in arguments[1:]]
            return found if len(found) > 1 else found[0]
        given = [self.result(part) for part in arguments if not isinstance(part, dict)]
        if path == "list":
            return given
        if path == "inputs":
            return [self[name] for name in given[0]]
        if path[0] == ".":
            return getattr(given[0], path[1:])(*given[1:], **named)
        return resolve_name(path if path.startswith("numpy.") else f"fourpole.{path}")(*given, **named)

    def _is_stated(self, part: Any) -> bool:
        return not isinstance(part, str) or part[:1] == "=" or part in self or part in _CALLS["objects"]


def _flat(result: Any) -> Iterator[Any]:
    """The numbers of a result in their order."""
    if isinstance(result, tuple | list):
        for part in result:
            yield from _flat(part)
    else:
        yield from np.ravel(result)


def phasors_of(
    frequency: float,
    amplitudes: Sequence[complex],
    std: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    common: float = 0.0,
    frequency_std: float = 0.0,
    dof: float = np.inf,
) -> Phasors:
    """The amplitudes of a test, with noise of each and with noise that V1 and V2 have in common."""
    both = np.outer([0, 0, 1, 0, 1, 0], [0, 0, 1, 0, 1, 0]) + np.outer([0, 0, 0, 1, 0, 1], [0, 0, 0, 1, 0, 1])
    covariance = np.diag(np.repeat(std, 2) ** 2) + common**2 * both
    test = (np.array([one]) for one in (frequency, amplitudes, covariance, frequency_std, dof))
    return Phasors(*test)


def spread(covariance: FloatArray) -> list[float]:
    """Standard uncertainties of two values of a test, and their correlation."""
    one, other = np.sqrt(np.diag(covariance[0]))
    return [one, other, covariance[0, 0, 1] / (one * other)]


def recording_of(rate: float, channels: Mapping[str, Mapping[str, Any]], **samples: FloatArray) -> Recording:
    """A recording of channels with their measuring chains."""
    made = {}
    for role, stated in channels.items():
        chain = tuple(link(*stated[key]) for key, link in _LINKS.items() if key in stated)
        others = {key: value for key, value in stated.items() if key not in _LINKS}
        made[role] = Channel(samples[role], **others, chain=chain)
    return Recording(rate, made)
