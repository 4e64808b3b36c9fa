"""Words of messages."""

from __future__ import annotations

__all__ = ["counted"]


def counted(number: int, what: str) -> str:
    """ "1 piece", "2 pieces", "1,200 pieces"."""
    return f"{number:,} {what}" + ("" if number == 1 else "s")
