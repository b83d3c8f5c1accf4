"""What Fourpole says first of a rig: its best explanation of a misfit, or the commonest check that is not ok."""

from __future__ import annotations

from collections import Counter
from typing import Any


def said(study: dict[str, Any], bad: list[dict[str, str]]) -> list[dict[str, Any]]:
    """The sentence as a row of causes.csv with rank 0; no row if there is none."""
    notes = [note for rig in (study.get("joint") or {}).values() for note in rig["notes"]]
    codes = Counter(check["code"] for check in bad)
    if notes:
        _, best, cause = notes[0].partition("best explained by ")
        text = (best + cause if best else notes[0]).split("; ")[0]
    elif codes:
        code, count = codes.most_common(1)[0]
        text = f"rows whose check of {code} is not ok: {count}"
    else:
        return []
    return [{"rank": 0, "cause": "", "channel or part": "", "said": text}]
