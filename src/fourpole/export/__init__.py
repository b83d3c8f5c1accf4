"""Export of results to files of other tools: a workbook, MATLAB, TYDEX, UFF 58 and NetCDF."""

from fourpole.export.kinds import KINDS, Exported, export_results

__all__ = ["KINDS", "Exported", "export_results"]
