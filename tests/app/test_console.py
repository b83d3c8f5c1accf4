"""How a command ends that a signal stops."""

from __future__ import annotations

import subprocess
import sys

import pytest

from fourpole.app import console

#: A signal arrives while an object is deleted, where Python ignores every exception.
DELETED = """
import os, signal, sys, time
from fourpole.app.console import end_in_order, run_to_exit

class Deleted:
    def __del__(self):
        os.kill(os.getpid(), getattr(signal, sys.argv[1]))
        time.sleep(0.01)

def run():
    one = Deleted()
    del one
    time.sleep(60)

end_in_order()
try:
    run_to_exit(run)
except BaseException as ended:
    sys.exit(ended.exit_code)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent in another way there")
@pytest.mark.parametrize(("number", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_a_signal_is_obeyed_also_while_an_object_is_deleted(number, code):
    ran = subprocess.run(
        [sys.executable, "-c", DELETED, number], capture_output=True, text=True, timeout=55, check=False
    )
    assert ran.returncode == code, ran.stderr
    assert ran.stderr.startswith("stopped; no file is half-written")


def test_progress_in_a_log_is_a_line_every_ten_seconds(monkeypatch, capsys):
    now = iter([0.0, 4.0, 9.9, 10.0, 15.0, 20.5, 300.0])
    monkeypatch.setattr(console.time, "monotonic", lambda: next(now))
    with console.progress("analysing") as advance:
        for done in (10, 20, 25, 30, 50, 231):
            advance(done, 231)
    assert capsys.readouterr().err.splitlines() == [
        "analysing: 25 of 231, about 82 s left",
        "analysing: 50 of 231, about 74 s left",
    ]
