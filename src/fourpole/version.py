"""The version of Fourpole."""

VERSION = "0.1.0"
