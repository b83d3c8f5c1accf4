"""The version of Fourpole."""

VERSION = "0.2.0"
