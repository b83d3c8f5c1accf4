"""report.html: one file that opens offline, with all results of an analysed campaign."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from markupsafe import Markup

from fourpole.core.checks import VERDICTS
from fourpole.core.digits import number
from fourpole.findings.list import CheckRow, checks_by_test
from fourpole.io.write import write_text
from fourpole.plot.cards import shown_rows
from fourpole.report.cards import embedded, make_cards
from fourpole.report.digits import counted, joined
from fourpole.report.front import front_page, short_names
from fourpole.report.html import inline, packaged, rendered, svg_address
from fourpole.report.models import models_section
from fourpole.report.rows import DYNAMIC, STATIC, channel_rows, result_rows, rig_rows, tested
from fourpole.report.words.limits import limits
from fourpole.report.words.rig import GROUPS, RigInWords, rigs_in_words
from fourpole.report.words.sentence import Sentence, inertia_table
from fourpole.study.record import section, texts
from fourpole.study.study import Study
from fourpole.study.tables import verdict_counts

#: The templates of the parts of the page, by name; `page_parts` has what they show.
PARTS = {
    name: packaged(f"parts/{name}.html")
    for name in (
        "macros", "front", "tested", "inertia", "findings", "rig", "rig-as-found", "limits", "results", "remarks",
        "models", "figures", "cards", "run", "compared",
    )
}  # fmt: skip
#: The scripts of the page, in their order: tables, curves, and what is the page's own.
SCRIPTS = ("tables.js", "draw.js", "page.js")
#: Keys of the figures on the first page.
FRONT = ("first-stiffness", "first-tr")
#: Keys of the figures that are folded below the others.
_FOR_EXPERTS = ("rig-found", "rig-residual", "mass-gain", "model-choice")
#: Up to this number the tests of a finding or a remark are listed by name.
_NAMED = 12


@dataclass(frozen=True)
class ReportFigure:
    """A figure as the page shows it.

    Parameters
    ----------
    key : str
        Short name, of letters, digits and dashes.
    title, caption : str
        Plain text.
    svg : str
        The drawing, a whole SVG file: part of the page where it holds nothing but shapes, texts and links within the
        page, otherwise an image, so that nothing in it can reach the page.
    number : int
        That of a figure of the paper, which its title has; 0 for another one.
    """

    key: str
    title: str
    caption: str
    svg: str
    number: int = 0

    @property
    def address(self) -> str:
        """The drawing as a data: URL."""
        return svg_address(_compact(self.svg).encode())

    @property
    def inline(self) -> Markup | None:
        """The drawing as a part of the page, whose points are links; None where it must be an image."""
        return inline(_compact(self.svg), self.title)

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height of its view box, so that the page keeps the space free; None if it has none."""
        found = re.search(r'viewBox="[-\d.]+ [-\d.]+ ([\d.]+) ([\d.]+)"', self.svg[:4000])
        return (round(float(found[1])), round(float(found[2]))) if found else None


def write_report(
    results: Study, path: str | Path, *, findings: Sequence[Sentence], figures: Mapping[str, ReportFigure]
) -> None:
    """Write report.html in one step.

    Parameters
    ----------
    results : Study
        Tables of an analysed campaign.
    path : path
        The file; its folder must exist.
    findings : sequence of Sentence
        The findings in words, in the order of the page; findings of one topic are put together.
    figures : mapping of str to ReportFigure
        The figures, by their keys, in the order of the page.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    write_text(path, render_report(results, findings=findings, figures=figures))


def render_report(results: Study, *, findings: Sequence[Sentence], figures: Mapping[str, ReportFigure]) -> str:
    """The page that `write_report` writes, as text.

    Whatever stands in the tables, the record, the findings and the captions is escaped. The page loads nothing from
    anywhere: style, script, figures and the data of the cards are inside, and its policy lets no other script run.
    """
    shown = page_parts(results, findings, figures)
    front, script = shown["front"], "".join(map(packaged, SCRIPTS))
    footing = " · ".join(
        part for part in (front.laboratory, front.number, str(results.record.get("title") or "")) if part
    )
    return rendered(
        {"page": packaged("template.html"), **PARTS},
        **shown,
        footing=Markup(_css_text(footing)),
        style=Markup(packaged("page.css")),
        script=Markup(script),
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
    )


def page_parts(results: Study, findings: Sequence[Sentence], figures: Mapping[str, ReportFigure]) -> dict[str, Any]:
    """What the templates of `PARTS` show, in the units that the results want."""
    cards, static_keys, dynamic_keys = make_cards(results)
    static = result_rows(results, results.static, STATIC, static_keys)
    some = shown_rows(results).tolist()
    dynamic = result_rows(results, results.dynamic[some], DYNAMIC, [dynamic_keys[at] for at in some])
    where = {card.test: card.key for card in cards}
    short = short_names(where)
    record = results.record
    topics, remarks = (
        _topics(findings, where),
        _remarks([*_remarked(results, dynamic_keys), *static.rows], checks_by_test(results.checks)),
    )
    shown = {key: figure for key, figure in figures.items() if key not in FRONT}
    said = [rig.rests for rig in results.rigs if rig.rests]  # stands on the first page
    numbered = _numbered(list(shown.values()))
    models = results.models.models if results.models else ()
    return {
        "title": str(record.get("title") or "") or "Campaign without a title",
        "front": front_page(results),
        "front_figures": [figures[key] for key in FRONT if key in figures],
        "counted": counted,
        "counts": verdict_counts(results.static, results.dynamic),
        "cards": cards,
        "short": short,
        "tables": [
            {"key": key, "name": name, "table": table}
            for key, name, table in (
                ("dynamic", "Dynamic tests", dynamic),
                ("static", "Static tests, per preload in use", static),
            )
            if table.rows
        ],
        "left_out": results.dynamic.height - len(some),
        "tyres": tested(results),
        "tyre_index": {tyre: at for at, tyre in enumerate(dict.fromkeys(card.tyre for card in cards))},
        "verdicts": VERDICTS,
        "topics": topics,
        "inertia": inertia_table(results),
        "rigs": rig_rows(record),
        "channels": channel_rows(record),
        "sample_rate": section(record, "stated").get("sample_rate [Hz]"),
        "rigs_found": [_rig_as_found(found, where) for found in rigs_in_words(results)],
        "limits": limits(results),
        "models": models_section(results),
        "chosen": joined(f"{one.model} for {one.tyre}" if one.tyre else one.model for one in models),
        "lacks_models": results.models is None and results.dynamic.height > 0,
        "faults": list(results.faults),
        "assumptions": texts(record.get("assumptions")),
        "notes": [one for one in texts(record.get("notes")) if not any(rests in one for rests in said)],
        "figures": numbered,
        "for_experts": [heading for heading, figure in numbered if figure.key in _FOR_EXPERTS],
        "remarks": remarks,
        "settings": {str(name): str(value) for name, value in section(record, "settings").items()},
        "versions": _versions(record),
        "hashes": {str(name): str(value) for name, value in section(record, "sha256").items()},
        "data": Markup(embedded({card.key: card.body for card in cards})),
    }


def _css_text(text: str) -> str:
    """A text as a string of a style sheet inside a page, with every sign but letters, digits and blanks escaped."""
    return '"' + "".join(c if (c.isalnum() and c.isascii()) or c == " " else f"\\{ord(c):x} " for c in text[:120]) + '"'


def _rig_as_found(about: RigInWords, where: Mapping[str, str]) -> dict[str, Any]:
    """One rig: its values by group, and its largest outliers, each with its card and the factor of its variance."""
    groups = [(heading, [value for value in about.values if value.group is group]) for group, heading in GROUPS.items()]
    named = [(one.test, where.get(one.test, ""), number(one.factor, 2)) for one in about.outliers[:_NAMED]]
    return {
        "about": about,
        "groups": [(heading, values) for heading, values in groups if values],
        "outliers": named,
        "more": len(about.outliers) - len(named),
    }


def _topics(findings: Sequence[Sentence], where: Mapping[str, str]) -> dict[str, list[dict[str, Any]]]:
    """Findings by topic, in the order of the first finding of each topic."""
    topics: dict[str, list[dict[str, Any]]] = {}
    for finding in findings:
        names = list(dict.fromkeys(finding.tests))
        linked = [(name, where.get(name, "")) for name in names[:_NAMED]]
        entry = {"text": finding.text, "tests": linked, "more": len(names) - len(linked)}
        topics.setdefault(finding.topic, []).append(entry)
    return topics


def _remarked(results: Study, cards: Sequence[str]) -> list[SimpleNamespace]:
    """The dynamic tests with a remark, each once."""
    found: dict[str, SimpleNamespace] = {}
    columns = (results.dynamic[name].to_list() for name in ("test", "verdict", "remarks"))
    for card, test, verdict, remarks in zip(cards, *columns, strict=True):
        if remarks:
            found.setdefault(card, SimpleNamespace(test=str(test), card=card, verdict=verdict, remarks=str(remarks)))
    return [*found.values()]


def _remarks(rows: Sequence[Any], short: Mapping[str, Sequence[CheckRow]]) -> list[dict[str, Any]]:
    """Remarks of the checks, rejections first, each with its tests.

    Checks with one code are one remark, in the short form of the code; rows and cards have the numbers.
    """
    groups: dict[tuple[str, str], dict[str, str]] = {}
    for row in rows:
        for one in short.get(row.test) or [CheckRow(row.verdict, None, "")]:
            text = "; ".join(part for part in (one.cause, one.remedy) if part) if one.cause else row.remarks
            if row.remarks:
                groups.setdefault((one.verdict, text), {})[row.test] = row.card
    found = [
        {"verdict": verdict, "text": text, "cards": [*tests.items()][:_NAMED], "more": max(0, len(tests) - _NAMED)}
        for (verdict, text), tests in groups.items()
    ]
    return sorted(found, key=lambda remark: -VERDICTS.index(remark["verdict"]))


def _numbered(figures: Sequence[ReportFigure]) -> list[tuple[str, ReportFigure]]:
    """Figures with their headings; a title without a number gets one above the largest number of the other titles."""
    count = max((figure.number for figure in figures), default=0)
    headed = []
    for figure in figures:
        count += figure.number == 0
        title = figure.title if figure.number else f"Figure {count}: {figure.title}"
        headed.append((title if title.endswith((".", "?", "!")) else f"{title}.", figure))
    return headed


def _compact(svg: str) -> str:
    """An SVG without its invisible parts: prolog, metadata, space between elements and in paths."""
    svg = re.sub(r"<\?xml.*?\?>|<!DOCTYPE[^>\[]*>|<!--.*?-->|<metadata>.*?</metadata>", "", svg, flags=re.S)
    svg = re.sub(r">[^\S\n]*+\n\s*+<", "><", svg)
    return " ".join(map(str.strip, svg.split("\n"))).strip()


def _versions(record: Mapping[str, Any]) -> dict[str, str]:
    """Versions by program, and the commit of Fourpole where it is known."""
    found = {str(name): str(value) for name, value in section(record, "versions").items()}
    made = section(record, "origin")
    if made.get("commit"):
        changed = ", files changed since" if made.get("changed") else ""
        found["commit of fourpole"] = f"{str(made['commit'])[:12]}{changed}"
    return found
