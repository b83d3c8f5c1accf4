"""All results of a laboratory as one Parquet data set: `gather` writes it, `scan` reads it, `difference` compares.

The data set is a folder with one folder per table (`tests`, `static`, `rig`, `budget`, `covariance`), which hold one
Parquet file per campaign. docs/lab.md has its columns and queries for DuckDB and polars.
"""

from fourpole.lab.dataset import SCHEMA, TABLES, Gathered, difference, gather, scan

__all__ = ["SCHEMA", "TABLES", "Gathered", "difference", "gather", "scan"]
