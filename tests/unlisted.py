"""Results without a list, as those of older versions: they are read as they lie, so that a test can change them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path


def unlisted(folder: Path) -> Path:
    """The folder, whose study.json lists no files any more."""
    study = folder / "study.json"
    record = json.loads(study.read_text(encoding="utf-8"))
    for key in ("sizes", "seal"):
        record.pop(key, None)
    study.write_text(json.dumps(record), encoding="utf-8")
    shutil.rmtree(folder / ".store", ignore_errors=True)
    return folder
