"""Many files together: at whatever step a process is killed or fails, the folder is the former one or the new one."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from fourpole.errors import FileError
from fourpole.io import staging
from fourpole.io.staging import recover, staged
from fourpole.io.write import remove_leftovers

FORMER = {
    "a.csv": "former",
    "figures/1.svg": "former",
    "gone.csv": "former",
    "own/notes.txt": "mine",
    "own.txt": "mine",
}
NEW = {"a.csv": "new", "figures/1.svg": "new", "figures/2.svg": "new", "model.json": "new"}
AFTER = {**FORMER, **NEW}
del AFTER["gone.csv"]
#: Processes, forked from one, of which each replaces files and kills itself before its n-th renaming or deletion.
KILLED = """
import json, os, signal, sys
from pathlib import Path
from fourpole.io.staging import recover, staged

jobs, new = map(json.loads, sys.argv[1:])
left = 0

def counted(true):
    def call(self, *given, **more):
        global left
        if self.name != "lock" and left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        left -= 1
        return true(self, *given, **more)
    return call

Path.replace, Path.unlink = counted(Path.replace), counted(Path.unlink)
for folder, left, what in jobs:
    if process := os.fork():
        print(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), flush=True)
        continue
    if what == "recover":
        recover(Path(folder))
    else:
        with staged(Path(folder), ["gone.csv", "never.csv"]) as place:
            for name, text in new.items():
                (place / name).parent.mkdir(exist_ok=True)
                (place / name).write_text(text)
    os._exit(0)
"""
STEPS = 12  # the journal's two, and of five files the former one and the new one


def written(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def tree(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def killed(*jobs: tuple[Path, int, str]) -> list[int]:
    """Exit codes of processes that stage or recover a folder up to a step."""
    given = [json.dumps([(str(folder), step, what) for folder, step, what in jobs]), json.dumps(NEW)]
    done = subprocess.run([sys.executable, "-c", KILLED, *given], check=True, capture_output=True, text=True)
    return [int(code) for code in done.stdout.split()]


def replace_all(folder: Path) -> None:
    with staged(folder, ["gone.csv", "never.csv"]) as new:
        written(new, NEW)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return written(tmp_path / "results", FORMER)


def test_all_files_are_replaced_and_the_users_own_stay(folder: Path) -> None:
    replace_all(folder)
    assert tree(folder) == AFTER
    assert sorted(path.name for path in folder.iterdir()) == ["a.csv", "figures", "model.json", "own", "own.txt"]


def test_a_failure_before_the_end_changes_nothing(folder: Path) -> None:
    def stopped() -> None:
        with staged(folder, ["gone.csv"]) as new:
            written(new, NEW)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert tree(folder) == FORMER


@pytest.mark.skipif(sys.platform == "win32", reason="processes are killed in another way there")
def test_a_process_killed_at_any_step_leaves_the_former_files_or_the_new_ones(tmp_path: Path) -> None:
    """The next command puts the former ones back; it may be killed at any step itself."""
    ended = []
    folders = [written(tmp_path / str(step), FORMER) for step in range(STEPS)]
    codes = killed(*((folder, step, "stage") for step, folder in enumerate(folders)))
    killed(*((folders[step], step // 3, "recover") for step in range(3, STEPS, 4)))
    for folder, code in zip(folders, codes, strict=True):
        recover(folder)
        assert tree(folder) in (FORMER, AFTER)
        assert not list(folder.glob(".*"))
        ended.append((code, tree(folder) == AFTER))
    assert ended == [(-9, False)] * (STEPS - 1) + [(0, True)]
    replace_all(tmp_path / "5")
    assert tree(tmp_path / "5") == AFTER


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("step", range(1, 10))
def test_an_error_at_any_renaming_puts_the_former_files_back(folder: Path, monkeypatch, step, error) -> None:
    true, left = Path.replace, step

    def failing(self: Path, target: Path) -> Path:
        nonlocal left
        left -= 1
        if left == 0:
            raise error
        return true(self, target)

    monkeypatch.setattr(Path, "replace", failing)
    wanted = FileError if isinstance(error, OSError) else KeyboardInterrupt
    with pytest.raises(wanted) as raised:
        replace_all(folder)
    if wanted is FileError:
        assert "No space left on device; free some space and run it again; all files are the former ones" in str(
            raised.value
        )
    monkeypatch.undo()
    assert tree(folder) == FORMER
    assert not list(folder.glob(".*"))


def test_where_a_former_file_cannot_be_put_back_the_next_command_does_it(folder: Path, monkeypatch) -> None:
    true = staging._undo

    def open_elsewhere(self: Path, target: Path) -> Path:
        raise PermissionError(13, "Permission denied")

    def undo(*given: Path) -> None:
        monkeypatch.setattr(Path, "replace", open_elsewhere)
        true(*given)

    monkeypatch.setattr(staging, "_undo", undo)
    (folder / "model.json").mkdir()
    with pytest.raises(FileError, match=r"model\.json: cannot be written: .*; the next command puts the former files"):
        replace_all(folder)
    monkeypatch.undo()
    (folder / "model.json").rmdir()
    recover(folder)
    assert tree(folder) == FORMER


def test_a_folder_is_never_replaced_by_a_file(folder: Path) -> None:
    written(folder, {"model.json/mine": "mine"})
    with pytest.raises(FileError, match=r"model\.json: cannot be written: .*folder"):
        replace_all(folder)
    assert tree(folder) == {**FORMER, "model.json/mine": "mine"}


def test_what_a_running_process_stages_is_left_alone(folder: Path) -> None:
    with staged(folder) as new:
        written(new, NEW)
        code = "import sys; from fourpole.io.staging import recover; recover(sys.argv[1])"
        subprocess.run([sys.executable, "-c", code, str(folder)], check=True)
        assert tree(new) == NEW
    assert tree(folder) == {**FORMER, **NEW}


def test_hidden_files_of_killed_processes_go_and_a_former_folder_inside_stays(folder: Path) -> None:
    for name in (".a.csv.0123456789ab.tmp/a.csv", ".tydex.0123456789ab.tmp/tydex.old/kept", ".mine/kept"):
        written(folder, {name: "half"})
    remove_leftovers(folder)
    assert len(tree(folder)) == len(FORMER) + 3  # of a running process, as far as the time says
    remove_leftovers(folder, abandoned=0.0)
    assert sorted(path.name for path in folder.glob(".*")) == [".mine", ".tydex.0123456789ab.tmp"]


def test_a_folder_that_is_not_there_or_cannot_be_written_is_an_error_of_the_file(tmp_path: Path) -> None:
    recover(tmp_path / "none")
    with pytest.raises(FileError, match="none: cannot be written"), staged(tmp_path / "none"):
        pass
