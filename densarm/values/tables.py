"""Tables: a dataclass from the plain data of a TOML or JSON table; errors name the key."""

import json
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from densarm.errors import InvalidValueError, UnknownNameError

T = TypeVar("T")


def parse_table(name: str, kind: type[T], data: Any) -> T:
    """Return the dataclass `kind` filled from the table `data` of a name.

    Raises:
        UnknownNameError: a key that the dataclass does not have.
        InvalidValueError: a value of a wrong type or out of its range, with its key.
    """
    if not isinstance(data, Mapping):
        raise InvalidValueError(name, data, "a table")
    known = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    for key, value in data.items():
        if key not in known:
            raise UnknownNameError(f"key of [{name}]", key, known)
        try:
            json.dumps(value)
        except (TypeError, ValueError):  # a date, which TOML has
            allowed = "a string, number, boolean, list or table"
            raise InvalidValueError(f"{name}.{key}", value, allowed) from None
    try:
        # Strict parsing takes strings for enums and lists for tuples from JSON only.
        return TypeAdapter(kind).validate_json(json.dumps(data), strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        own = first.get("ctx", {}).get("error")
        if isinstance(own, InvalidValueError):
            raise InvalidValueError(f"{name}.{own.name}", own.value, own.allowed) from None
        key = ".".join([name, *(str(part) for part in first["loc"][:1])])
        if first["type"] == "missing":
            raise InvalidValueError(key, None, "given") from None
        message = first["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
        raise InvalidValueError(key, first["input"], message) from None
