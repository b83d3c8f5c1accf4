"""Planning: the tests that a campaign needs for a wanted uncertainty, and their run sheet."""
