"""Samples for pictures lie in the user's own cache folder, in limited room, and come from nowhere else."""

from __future__ import annotations

import json
import os
import shutil
import stat
import time
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import pytest
from tests.served.server import Server, serving

from fourpole.served import signals
from fourpole.served.signals import Collector, Kept, Wanted

COUNT = 3000


@pytest.fixture
def collector(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Collector]:
    """One that reads in its own process."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(signals, "child", lambda _: Mock())
    monkeypatch.setattr(signals, "read_apart", lambda read, *arguments, **options: read(*arguments, **options))
    made = Collector()
    yield made
    made.close()


def written(folder: Path, name: str, value: float = 1.0) -> Wanted:
    rows = "\n".join(f"{at / 1000},{value * (at % 7)}" for at in range(COUNT))
    (folder / name).write_text(f"t [s],F1 [N]\n{rows}\n")
    return Wanted(folder / name, "", ("F1",))


def got(collector: Collector, wanted: Wanted) -> Kept:
    until = time.monotonic() + 60
    while time.monotonic() < until:
        kept = collector.get(wanted)
        if isinstance(kept, Kept):
            return kept
    pytest.fail("the recording is never read")


def test_they_are_kept_for_the_user_alone(collector: Collector, tmp_path: Path) -> None:
    kept = got(collector, written(tmp_path, "a.csv"))
    assert kept.folder.parent == tmp_path / "home" / "fourpole" / "signals"
    assert stat.S_IMODE(kept.folder.parent.stat().st_mode) == 0o700
    about = (kept.folder / "about.json").stat()
    again = got(collector, Wanted(tmp_path / "a.csv", "", ("F1",)))
    assert again.folder == kept.folder
    assert (again.folder / "about.json").stat().st_ino == about.st_ino


def test_their_room_is_that_of_all_campaigns(
    collector: Collector, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = got(collector, written(tmp_path, "a.csv"))
    os.utime(first.folder / "about.json", (1, 1))
    size = sum(path.stat().st_size for path in first.folder.iterdir())
    monkeypatch.setattr(signals, "_ALL_ROOM", 2.5 * size)
    (tmp_path / "other").mkdir()
    left = first.folder.with_name(".signals-0.tmp")
    left.mkdir()
    os.utime(left, (1, 1))
    others = [got(collector, written(tmp_path / "other", name)) for name in ("b.csv", "c.csv")]
    assert not first.folder.exists()
    assert not left.exists()
    assert all(one.folder.exists() for one in others)


def test_without_a_cache_folder_they_are_kept_while_the_server_runs(
    collector: Collector, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    kept = got(collector, written(tmp_path, "a.csv"))
    assert stat.S_IMODE(kept.folder.parent.stat().st_mode) == 0o700
    collector.close()
    assert not kept.folder.parent.exists()


@pytest.mark.sampled(4)
def test_what_a_folder_brings_as_such_samples_is_not_shown(analysed: Path, tmp_path: Path) -> None:
    """Samples of zeros, under the names that a page looks for, lie in the folder: the picture stays the same."""
    root = tmp_path / "root"
    shutil.copytree(analysed, root / "one")
    with serving(root) as server:
        before = picture(server)
        (about,) = server.cache.rglob("about.json")
        assert not (root / "one" / "results" / "cache" / "signals").exists()
        for name in (about.parent.name, about.parent.name[:24]):
            hostile = root / "one" / "results" / "cache" / "signals" / name
            shutil.copytree(about.parent, hostile)
            for samples in hostile.glob("*.f64"):
                samples.write_bytes(bytes(samples.stat().st_size))
        shutil.rmtree(about.parent)
        assert picture(server) == before


def picture(server: Server) -> list[dict]:
    until = time.monotonic() + 60
    while time.monotonic() < until:
        found = json.loads(server.ask("/c/one/tests/D1/signals", headers={"Accept": "application/json"})[1])
        if "channels" in found:
            return found["channels"]
    pytest.fail("the recording is never read")
