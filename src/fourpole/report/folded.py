"""The sentence under which each part of the page is folded."""

from __future__ import annotations

from fourpole.report.words.phrases import counted, joined
from fourpole.study.record import section, texts
from fourpole.study.study import Study
from fourpole.study.tables import verdict_counts


def folded(results: Study, *, topics: int, findings: int, remarks: int, figures: int) -> dict[str, str]:
    """What each part holds, by the key of the part; the counts are those of the page."""
    counts = verdict_counts(results.static, results.dynamic)
    tests = sum(counts.values())
    specimens = {*results.static["tyre"].to_list(), *results.dynamic["tyre"].to_list()}
    assumed = len(texts(results.record.get("assumptions")))
    misfits = [rig for rig in results.rigs if not rig.fits]
    models = results.models.models if results.models else ()
    chosen = [f"{one.model} for {one.tyre}" if one.tyre else one.model for one in models]
    hashes = len(section(results.record, "sha256"))
    files = f"; {counted(hashes, 'file')} with their SHA-256" if hashes else ""
    notes = f", with {counted(assumed, 'note')}" if assumed else ""
    return {
        "tested": f"{counted(tests, 'test')} on {counted(len(specimens), 'specimen')}, with their conditions.",
        "findings": f"{counted(findings, 'sentence')} on {counted(topics, 'topic')}, the largest effects first.",
        "rig": f"As campaign.toml states them{notes}.",
        "rig-as-found": "The rig as stated does not fit these tests."
        if misfits
        else "Rig and sensors fit these tests; each value as stated and as found.",
        "limits": "The largest sources of uncertainty, and the cheapest remedy of each.",
        "results": "All results of each test, to sort and to filter.",
        "remarks": f"{counted(remarks, 'remark')} on {counted(counts['warning'] + counts['rejected'], 'test')}.",
        "models": f"Chosen: {joined(chosen)}." if chosen else "None is fitted, or it could not be used.",
        "figures": f"{counted(figures, 'figure')}.",
        "cards": "Signals, hysteresis loop and numbers of each recording.",
        "run": f"Settings and versions{files}.",
    }
