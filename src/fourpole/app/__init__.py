"""Commands: read, call, show; no formula lives here."""
