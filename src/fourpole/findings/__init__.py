"""Findings of a campaign as data: each finding with its effect, its uncertainty, its outcome and its tests."""

from fourpole.findings.finding import Finding, FindingConditions, Holds, Setup, Topic
from fourpole.findings.list import by_size, findings
from fourpole.findings.table import findings_table

__all__ = ["Finding", "FindingConditions", "Holds", "Setup", "Topic", "by_size", "findings", "findings_table"]
