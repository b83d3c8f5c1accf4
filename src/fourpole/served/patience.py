"""Requests that never end: a connection that sends half of one is closed after a time."""

from __future__ import annotations

import asyncio
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol


class PatientProtocol(H11Protocol):
    """HTTP as uvicorn speaks it, with an end to the wait for the rest of a request.

    Attributes
    ----------
    whole_head, next_part : float [s]
        Time for the whole head of a request, and for each next part of its body.
    """

    whole_head, next_part = 20.0, 60.0
    _due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """Begin to wait for the first request."""
        super().connection_made(transport)
        self._wait(self.whole_head)

    def data_received(self, data: bytes) -> None:
        """Take a part of a request, and wait for the next one if it is not whole."""
        super().data_received(data)
        if self.conn.their_state is h11.SEND_BODY:
            self._wait(self.next_part)
        elif self.conn.their_state is not h11.IDLE:
            self._rest()
        elif self._due is None:
            self._wait(self.whole_head)

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        self._rest()
        super().connection_lost(exc)

    def _wait(self, seconds: float) -> None:
        self._rest()
        self._due = self.loop.call_later(seconds, self._late)

    def _rest(self) -> None:
        if self._due is not None:
            self._due.cancel()
            self._due = None

    def _late(self) -> None:
        self._due = None
        if self.flow.read_paused:  # the server is behind, not the other side
            self._wait(self.next_part)
        else:
            self.transport.abort()
