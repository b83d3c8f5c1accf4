"""The command as a module: ``python -m fourpole``."""

from fourpole.app.cli import main

if __name__ == "__main__":
    main()
