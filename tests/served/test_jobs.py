"""Jobs are stopped at any time, also while their process is being made."""

from __future__ import annotations

import asyncio
from pathlib import Path

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
