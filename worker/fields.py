"""Reading what another version of this program may have written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any


def known_fields(kind: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the values that are fields of the dataclass `kind`: a newer version may have added others."""
    names = {field.name for field in fields(kind)}
    return {name: value for name, value in values.items() if name in names}
