"""Some files together: if one of them cannot be replaced, the folder is the former one."""

from __future__ import annotations

from pathlib import Path

import pytest

from fourpole.errors import FileError
from fourpole.io.lock import staged
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


def written(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def tree(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


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


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("step", range(1, 5))
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


def test_a_folder_is_never_replaced_by_a_file(folder: Path) -> None:
    written(folder, {"model.json/mine": "mine"})
    with pytest.raises(FileError, match=r"model\.json: cannot be written: .*folder"):
        replace_all(folder)
    assert tree(folder) == {**FORMER, "model.json/mine": "mine"}


def test_hidden_files_of_killed_processes_go_and_a_former_folder_inside_stays(folder: Path) -> None:
    for name in (".a.csv.0123456789ab.tmp/a.csv", ".tydex.0123456789ab.tmp/tydex.old/kept", ".mine/kept"):
        written(folder, {name: "half"})
    remove_leftovers(folder)
    assert len(tree(folder)) == len(FORMER) + 3  # of a running process, as far as the time says
    remove_leftovers(folder, abandoned=0.0)
    assert sorted(path.name for path in folder.glob(".*")) == [".mine", ".tydex.0123456789ab.tmp"]


def test_a_folder_that_is_not_there_or_cannot_be_written_is_an_error_of_the_file(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="none: cannot be written"), staged(tmp_path / "none"):
        pass
