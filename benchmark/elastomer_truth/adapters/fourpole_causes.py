"""The causes that Fourpole names in study.json and checks.csv, in the words of the benchmark."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from elastomer_truth.adapters.fourpole_said import said
from elastomer_truth.adapters.fourpole_words import CHECKS, cause_of

#: Checks that name one test.
_ONE_TEST = (
    "agreement", "K* curve", "K* curve of another condition", "labels", "copy", "stated frequency", "steady channel",
)  # fmt: skip
#: K1 over K' beyond which a unit is in doubt.
_UNIT = 3.0
#: Scatter of K* that no specimen of rubber need have [1].
_SCATTERS = 5e-3
_STATIC = {"K1 against K'": ("static gain", "load"), "K1 above K'": ("static gain", "load")}


def causes(
    study: dict[str, Any], checks: list[dict[str, str]], specimens: Iterable[dict[str, Any]]
) -> list[dict[str, Any]]:
    """At most three causes, best first: of the misfit of the rig, of specimens, recordings, single tests and K1.

    `specimens` are as stated: a scatter or drift that is stated is none.
    """
    found: list[tuple[str, str]] = []
    scatter = max(one.get("scatter_of_tests_relative", 0.0) for one in specimens)
    for rig in (study.get("joint") or {}).values():
        named = [] if rig.get("fits", True) else rig.get("candidates", [])
        found += [cause for each in named if (cause := cause_of(each))]
        if {"drift", "step"} & {*rig["note_codes"]}:
            found.append(("drift", "specimen"))
        if rig["scatter"] > max(2 * scatter, _SCATTERS):
            found.append(("scatter", "specimen"))
    bad = [check for check in checks if check["verdict"] != "ok"]
    tests = {check["test"] for check in checks}
    for code, cause in CHECKS.items():
        channels = [check["channel"] for check in bad if check["code"] == code]
        if channels and len({check["test"] for check in bad if check["code"] == code}) >= 0.3 * len(tests):
            channel = "V2" if code == "linearity of the rig" else max(set(channels), key=channels.count)
            found.append((cause, channel or "F1"))
    if any(check["code"] == "passivity of other tests" for check in bad):
        found += [("delay", "F1"), ("delay", "V1")]
    for check in bad:
        if check["code"] in _ONE_TEST and sum(c["code"] == check["code"] for c in bad) <= 3:
            found.append(("one test", check["test"]))
        if check["code"] in _STATIC:
            times = json.loads(check["values"] or "{}").get("times", 1.0)
            found += [("unit", "F1")] * (times > _UNIT) + [_STATIC[check["code"]]]
    ranked = list(dict.fromkeys(found))[:3]
    rows = [{"rank": at, "cause": cause, "channel or part": part} for at, (cause, part) in enumerate(ranked, 1)]
    return rows + said(study, bad)
