"""The scripts of this folder import each other by their names, when pytest collects them too."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
