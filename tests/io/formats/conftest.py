"""Hostile files, read as commands read them: in a worker process, here with little time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from fourpole.errors import FileError, TableError
from fourpole.io import child as children
from fourpole.io.child import read_apart
from fourpole.io.recordings import survey
from fourpole.io.signals import FileInfo, SignalInfo
from fourpole.study.recording import read_recording

Outcome = Callable[[Path, str], list[str]]


@pytest.fixture
def outcome(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Outcome:
    """What `info` and `read_recording` say of a file: the message of the error, empty if there is none."""
    monkeypatch.setattr(children, "SECONDS", 30.0)  # loading a library takes some of them under load

    def said(path: Path, channel: str) -> list[str]:
        stated = {"motion_in": {"column": channel, "unit": "m/s"}, "sample_rate": "100 Hz"}
        messages = []
        for use in (
            lambda: read_apart(survey, path, classes=(FileInfo, SignalInfo)),
            lambda: read_recording(path, stated),
        ):
            message = ""
            try:
                use()
            except (TableError, FileError) as error:
                message = str(error)
                assert path.name in message
                assert message.isprintable()
                assert len(message) < 1200
            messages.append(message)
        assert capfd.readouterr() == ("", "")
        return messages

    return said
