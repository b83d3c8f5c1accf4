"""`fourpole info`: what a file holds, or one clear message."""

from __future__ import annotations

import json

import numpy as np
import pytest


@pytest.fixture
def logged(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "log.bin"
    with nptdms.TdmsWriter(path) as file:
        data = {"wf_increment": 0.001, "unit_string": "N"}
        file.write_segment([nptdms.ChannelObject("warm", "F1\x1b[31m", np.zeros(500), data)])
        file.write_segment([nptdms.ChannelObject("test", "F1", np.zeros(2000), data)])
    return path


def test_it_lists_groups_channels_units_and_rates(run, logged):
    ran = run("info", logged)
    assert (ran.exit_code, ran.stderr) == (0, "")
    lines = ran.stdout.splitlines()
    assert lines[0].startswith("log.bin: NI TDMS")
    assert any(line.split()[:5] == ["test", "F1", "N", "2000", "1000"] for line in lines)
    assert "rate [Hz]" in ran.stdout
    assert "\x1b" not in ran.stdout


def test_for_programs_it_is_one_document(run, logged):
    found = json.loads(run("info", logged, "--json").stdout)
    assert found["file"] == "log.bin"
    assert [(signal["group"], signal["count"], signal["rate"]) for signal in found["signals"]] == [
        ("warm", 500, 1000.0),
        ("test", 2000, 1000.0),
    ]


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "there is no such file"), (b"", "is empty"), (b"\x00\x01\x02" * 99, "is binary, not text")],
)
def test_what_cannot_be_read_is_one_message(run, tmp_path, content, said):
    path = tmp_path / "file"
    if content is not None:
        path.write_bytes(content)
    ran = run("info", path)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in ran.stderr
    assert len(ran.stderr.splitlines()) == 1
