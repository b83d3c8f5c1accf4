"""Jobs are stopped at any time, also while their process is being made."""

from __future__ import annotations

import asyncio
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fourpole.served.jobs import Job, Jobs, Phase
from fourpole.served.workspace import Place


def test_a_job_that_is_stopped_while_it_starts_does_not_run(tmp_path: Path) -> None:
    async def stopped() -> Job:
        job = Jobs(1).start(Place("one", "one", tmp_path), "demo")
        while job.phase is Phase.WAITING:
            await asyncio.sleep(0)
        job.stop()
        async for _ in job.changes():
            pass
        return job

    job = asyncio.run(stopped())
    assert job.phase is Phase.STOPPED
    assert not job.messages
    assert list(tmp_path.iterdir()) == []


@pytest.mark.thorough
@pytest.mark.sampled(4)
def test_a_command_ends_with_the_server_that_was_killed(analysed: Path, tmp_path: Path) -> None:
    folder = tmp_path / "one"
    shutil.copytree(analysed, folder, ignore=shutil.ignore_patterns("results"))
    command = [sys.executable, "-m", "fourpole", "watch", str(folder), "--json"]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "FOURPOLE_EVENTS": "1"},
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stderr is not None
    with process:
        assert any("watching" in line for line in process.stderr)
        process.stdin.close()
        assert process.wait(30) == 130


def test_the_input_of_a_command_is_held_open(tmp_path: Path) -> None:
    async def running() -> bool:
        job = Jobs(1).start(Place("one", "one", tmp_path), "watch")
        while job._process is None and not job.over:
            await asyncio.sleep(0.01)
        held = job._process is not None and job._process.stdin is not None
        job.stop()
        async for _ in job.changes():
            pass
        return held

    assert asyncio.run(running())
