"""The former place of `fourpole.paper1982.models`."""

from fourpole.face import moved_to

__getattr__ = moved_to("fourpole.paper1982.models")
