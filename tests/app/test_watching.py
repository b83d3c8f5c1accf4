"""What `fourpole watch` shows of the analyses that it starts, one after the other."""

import json
import sys

from fourpole.app import watching
from fourpole.io.processes import start


def _said(count, report):
    """A program that prints what `analyse --json` does."""
    document = {"verdicts": {"ok": count, "warning": 0, "rejected": 0}, "route": "joint", "report": report}
    return f"print({json.dumps(document)!r})"


def test_what_a_later_analysis_prints_stands_alone(tmp_path, monkeypatch):
    programs = iter((_said(4, "x" * 100_000), _said(5, "r.html"), "print('no JSON')"))

    def started(_module, *_words, **settings):
        return start([sys.executable, "-c", next(programs)], **settings)

    monkeypatch.setattr(watching, "start_module", started)
    monkeypatch.setattr(watching, "_QUIET", -1.0)
    joint, said = watching._Joint(tmp_path), []
    for _ in range(3):
        assert joint.follow(new=True) == []
        assert joint._process.wait(60) == 0
        said.append(joint.follow(new=False))
    counts = "all tests together: {} tests, {} ok, 0 with a warning, 0 rejected (route: joint)"
    assert said == [
        [counts.format(4, 4), f"all tests together: report: {'x' * 100_000}"],
        [counts.format(5, 5), "all tests together: report: r.html"],
        [],
    ]
    joint.stop()
