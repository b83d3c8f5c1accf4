"""What `fourpole watch` shows of the analyses that it starts, one after the other."""

import sys

from fourpole.app import watching
from fourpole.io.processes import start


def test_what_a_later_analysis_prints_stands_alone(tmp_path, monkeypatch):
    programs = iter(
        ("print('x' * 200_000, '4 tests, 4 ok', sep='\\n')", "print('5 tests, 5 ok', 'report: r.html', sep='\\n')")
    )

    def started(_module, *_words, **settings):
        return start([sys.executable, "-c", next(programs)], **settings)

    monkeypatch.setattr(watching, "start_module", started)
    monkeypatch.setattr(watching, "_QUIET", -1.0)
    joint, said = watching._Joint(tmp_path), []
    for _ in range(2):
        assert joint.follow(new=True) == []
        assert joint._process.wait(60) == 0
        said.append(joint.follow(new=False))
    assert said == [
        ["all tests together: 4 tests, 4 ok"],
        ["all tests together: 5 tests, 5 ok", "all tests together: report: r.html"],
    ]
    joint.stop()
