"""What `fourpole watch` shows of the analyses that it starts, one after the other."""

import json
import sys

import pytest

from fourpole.app import watching
from fourpole.app.group import show
from fourpole.io.processes import start
from fourpole.study.watch import WatchedFile


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


class _Watch:
    """Two recordings that come one after the other; then Ctrl-C."""

    def __init__(self, _folder):
        self._looks = iter([[], [WatchedFile("D1", "d1.csv", "ok")], [WatchedFile("D2", "", "rejected", ("no file",))]])

    def warm(self):
        pass

    def look(self):
        try:
            return next(self._looks)
        except StopIteration:
            raise KeyboardInterrupt from None


@pytest.mark.parametrize(
    ("as_json", "said"),
    [(False, ["ok        D1", "REJECTED  D2", "          no file"]), (True, [("D1", []), ("D2", ["no file"])])],
)
def test_each_judgement_is_an_answer_as_it_comes(tmp_path, monkeypatch, capsys, as_json, said):
    monkeypatch.setattr(watching, "Watch", _Watch)
    monkeypatch.setattr(watching, "_EVERY", 0.0)
    with pytest.raises(KeyboardInterrupt):
        show(watching.run_watch(tmp_path), as_json=as_json)
    printed = capsys.readouterr()
    assert printed.err.replace("\n", "") == f"watching {tmp_path}; Ctrl-C ends it"
    lines = printed.out.splitlines()
    told = map(json.loads, lines) if as_json else ()
    assert ([(one["test"], one["remarks"]) for one in told] if as_json else lines) == said
