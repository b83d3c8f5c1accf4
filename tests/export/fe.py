"""Readers of FE input, written from the layouts of the programs' manuals, independently of what writes it here.

Each returns materials as (E_0 or None, Poisson's ratio or None, [(g, k, tau)]) or, for LS-DYNA, its cards.
"""

from __future__ import annotations

import re

import numpy as np


def relaxing(omega, rest, springs, times):
    """K* of a Prony series (N,)."""
    w = 1j * np.asarray(omega)[:, None] * np.asarray(times)
    return rest + (w / (1 + w)) @ np.asarray(springs)


def read_abaqus(text):
    """Abaqus: keyword lines begin with one star, comments with two; data lines are separated by commas."""
    materials, keyword = {}, ""
    for line in text.splitlines():
        assert len(line) <= 256
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            keyword, *options = (part.strip().upper() for part in line[1:].split(","))
            options = dict(part.split("=") for part in options if "=" in part)
            if keyword == "MATERIAL":
                name = options["NAME"]
                assert re.fullmatch(r"[A-Z]\w{0,79}", name)
                materials[name] = {"terms": [], "elastic": None}
            elif keyword == "ELASTIC":
                assert options["MODULI"] == "INSTANTANEOUS"
            elif keyword == "VISCOELASTIC":
                assert options["TIME"] == "PRONY"
            continue
        fields = [part.strip() for part in line.split(",")]
        assert all(len(field) <= 20 for field in fields)
        if keyword == "ELASTIC":
            materials[name]["elastic"] = tuple(map(float, fields))
        else:
            assert keyword == "VISCOELASTIC"
            materials[name]["terms"].append(tuple(map(float, fields)))
    return materials


def read_ansys(text):
    """APDL: one command per line, fields separated by commas; TBDATA,START,C1..C6 puts constants from START on."""
    materials, table = {}, None
    for line in text.splitlines():
        if line.startswith("!") or not line.strip():
            continue
        assert len(line) <= 640
        command, *fields = (part.strip() for part in line.split(","))
        if command == "MP":
            label, number, value = fields
            materials.setdefault(int(number), {})[label] = float(value)
        elif command == "TB":
            label, number, temperatures, points, option = fields
            assert (label, temperatures) == ("PRONY", "1")
            table = np.zeros(2 * int(points))
            materials.setdefault(int(number), {})[option] = table
        elif command == "TBTEMP":
            materials[int(number)]["TEMP"] = float(fields[0])
        else:
            assert command == "TBDATA"
            start, *constants = fields
            assert 1 <= len(constants) <= 6
            table[int(start) - 1 : int(start) - 1 + len(constants)] = list(map(float, constants))
    return materials


def read_dyna(text):
    """LS-DYNA: cards behind a keyword; fields have 10 columns, 20 behind a keyword that ends in a plus sign."""
    blocks = []
    lines = [line for line in text.splitlines() if not line.startswith("$")]
    assert lines[0] == "*KEYWORD"
    assert lines[-1] == "*END"
    for line in lines[1:-1]:
        if line.startswith("*"):
            width = 20 if line.endswith("+") else 10
            blocks.append((line[1:].rstrip("+"), []))
            continue
        assert len(line) <= 8 * width
        blocks[-1][1].append([line[at : at + width].strip() for at in range(0, len(line), width)])
    return blocks
