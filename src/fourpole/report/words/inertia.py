"""The mass of a specimen in words: a sentence for the findings, a short one for page one and the terminal."""

from __future__ import annotations

from types import SimpleNamespace

from fourpole import quantities as q
from fourpole.core.specimen import Form
from fourpole.findings.facts import Finding
from fourpole.findings.list import Inertia, inertias
from fourpole.quantities import Quantity
from fourpole.report.digits import in_unit, number, shown_as
from fourpole.report.words.phrases import SENTENCES, condition
from fourpole.study.study import Study

_SAID: dict[str, str] = SENTENCES["inertia"]
#: The columns of the table after the condition.
COLUMNS = (q.BELT_MASS, q.BELT_FREE, q.BELT_HELD, q.BELT_SHARE)


def inertia(finding: Finding, found: Inertia) -> str:
    """The mass of a specimen, its frequencies and its springs with U, as sentences."""
    values = {one.key: ranged_with_u(found, one) for one in COLUMNS}
    return _SAID[found.form.value].format(name=finding.specimens[0], **values)


def short_lines(results: Study) -> list[str]:
    """A line for each specimen that has a mass: the mass and the frequency with the rim held."""
    said = ((one, one.detail) for one in inertias(results))
    return [
        _SAID[f"short_{detail.form.value}"].format(
            name=one.specimens[0], mass=ranged_with_u(detail, q.BELT_MASS), free=ranged_with_u(detail, q.BELT_FREE)
        )
        for one, detail in said
        if isinstance(detail, Inertia)
    ]


def ranged_with_u(found: Inertia, quantity: Quantity) -> str:
    """A value ± U, or the lowest and the highest one with theirs, in the unit shown; empty where there is none."""
    seen = shown_as(quantity)
    texts = [" ± ".join(filter(None, in_unit(one, seen))) for one in found.ends(quantity)]
    return f"{' to '.join(dict.fromkeys(texts))} {seen.suffix}".rstrip()


def inertia_table(results: Study) -> SimpleNamespace | None:
    """The rows of the table of specimens with a mass; None without one."""
    found = inertias(results)
    rows = [
        SimpleNamespace(
            name=finding.specimens[0],
            place=condition(finding.conditions.axes, key),
            form=body.form.value,
            cells=[
                "–" if quantity is q.BELT_SHARE and body.form is Form.ROD else ranged_with_u(Inertia((body,)), quantity)
                for quantity in COLUMNS
            ],
            evidence=number(body.row[q.BELT_EVIDENCE.head], 3),
        )
        for finding in found
        if isinstance(finding.detail, Inertia)
        for key, body in zip(finding.conditions.keys, finding.detail.bodies, strict=True)
    ]
    return SimpleNamespace(columns=COLUMNS, rows=rows, meaning=q.BELT_EVIDENCE.meaning) if rows else None
