"""The quantities that findings are made of."""

from __future__ import annotations

from fourpole.findings.finding import Subject, Topic

__all__ = ["CYCLE_LOSS", "K1", "K2", "LOSS", "NONLINEARITY", "STORAGE", "C"]

_STATIC, _DYNAMIC = ("pressure", "load"), ("pressure", "load", "frequency")
K1 = Subject("K1", "K1 [N/m]", "u(K1) [N/m]", Topic.STATIC, _STATIC)
K2 = Subject("K2", "K2 [N/m]", "u(K2) [N/m]", Topic.DYNAMIC, _DYNAMIC)
C = Subject("C", "C [N s/m]", "u(C) [N s/m]", Topic.DAMPING, _DYNAMIC)
LOSS = Subject("loss factor", "loss factor [1]", "u(loss factor) [1]", Topic.LOSS, _DYNAMIC)
STORAGE = Subject("Re K*", "Re K* [N/m]", "u(Re K*) [N/m]", Topic.DYNAMIC, _DYNAMIC)
NONLINEARITY = Subject("nonlinearity", "nonlinearity [1]", "", Topic.NONLINEARITY, ("pressure",))
CYCLE_LOSS = Subject("hysteresis loss", "hysteresis loss [J]", "", Topic.LOSS, ("pressure",))
