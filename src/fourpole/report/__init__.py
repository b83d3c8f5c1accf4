"""Results become words and one HTML page."""
