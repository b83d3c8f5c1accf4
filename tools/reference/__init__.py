"""Physics in 50 digits, of which the reference data of `fourpole selftest` are made; it imports nothing of Fourpole."""
