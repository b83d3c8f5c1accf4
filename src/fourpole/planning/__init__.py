"""Which tests a campaign should have, and the sheet to run them by."""
