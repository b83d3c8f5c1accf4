"""CPU time of the calling process of an analysis by two workers, less that of the joint solution [s].

python bench/serial.py FOLDER prints it last.
"""

from __future__ import annotations

import sys
from typing import Any

from promises import own_cpu

from fourpole.__main__ import main as command
from fourpole.study import identify


def main() -> None:
    spent, solve = [], identify.solve_joint

    def timed(*args: Any, **kwargs: Any) -> Any:
        start = own_cpu()
        try:
            return solve(*args, **kwargs)
        finally:
            spent.append(own_cpu() - start)

    identify.solve_joint = timed
    sys.argv = ["fourpole", "analyse", sys.argv[1], "--tables-only", "--workers", "2"]
    try:
        command()
    except SystemExit as end:
        if end.code not in (None, 0, 3):
            raise
    print(own_cpu() - sum(spent))


if __name__ == "__main__":
    main()
