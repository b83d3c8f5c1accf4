"""The command `fourpole`, also as a module: ``python -m fourpole``."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command; its version is printed without loading the command line."""
    if sys.argv[1:] == ["--version"]:
        from fourpole.version import VERSION

        sys.stdout.write(f"fourpole {VERSION}\n")
        return
    from fourpole.app.cli import main as run

    run()


if __name__ == "__main__":
    main()
