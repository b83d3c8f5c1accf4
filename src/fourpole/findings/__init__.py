"""Findings of a campaign as data: each finding with its effect, its uncertainty, its outcome and its tests."""

from fourpole.findings.facts import Finding, FindingConditions, Holds, Setup, Topic, findings_table
from fourpole.findings.list import by_size, findings

__all__ = ["Finding", "FindingConditions", "Holds", "Setup", "Topic", "by_size", "findings", "findings_table"]
