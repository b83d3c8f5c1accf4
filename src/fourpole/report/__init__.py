"""The report: results in words and as one HTML page."""
