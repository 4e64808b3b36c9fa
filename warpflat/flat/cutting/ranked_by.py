"""What makes a cut the best."""

from __future__ import annotations

from typing import Literal

__all__ = ["RankedBy"]

#: By the energy that a cut releases in all, or per centimetre.
RankedBy = Literal["released", "per_cm"]
