"""The date that files carry: the present, or that of SOURCE_DATE_EPOCH, so that a repeat gives the same bytes."""

from __future__ import annotations

import os
import re
from datetime import datetime, timezone

from warpflat.core import InputError, quote_value

__all__ = ["source_date"]

_LAST = 253_402_300_799  # the end of the year 9999 [s]


def source_date() -> datetime:
    """Return the present, or the time that SOURCE_DATE_EPOCH [s] names.

    Raises:
        InputError: the variable is no number of seconds. Libraries would end with a traceback while they are imported.
    """
    given = os.environ.get("SOURCE_DATE_EPOCH")
    if given is None:
        return datetime.now().astimezone()
    if not re.fullmatch(r"[0-9]{1,12}", given) or int(given) > _LAST:
        raise InputError(
            f"SOURCE_DATE_EPOCH = {quote_value(given)}: it must be whole seconds since 1970, such as 1700000000"
        )
    return datetime.fromtimestamp(int(given), tz=timezone.utc)
