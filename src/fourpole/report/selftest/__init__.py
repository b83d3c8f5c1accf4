"""The self-test: what the installed package computes, held against reference data that it carries.

`reference/vectors.json` has inputs and values with 50 digits; `reference/campaigns` has whole campaigns with their
expected results. tools/make_reference.py of the repository makes both, from physics without code of the package.
"""

from __future__ import annotations
