"""Tables: a dataclass from the plain data of a TOML or JSON table; errors name the key."""

import json
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from densarm.errors import InvalidValueError, UnknownNameError

T = TypeVar("T")


def parse_table(name: str, kind: type[T], data: Any) -> T:
    """Return a dataclass filled from a table.

    Args:
        name: the table's name, for errors.
        kind: the dataclass; keys that it does not have are refused.
        data: the table.

    Raises:
        UnknownNameError: a key that the dataclass does not have.
        InvalidValueError: a value of a wrong type or out of its range, with its key.
    """
    if not isinstance(data, Mapping):
        raise InvalidValueError(name, data, "a table")
    known = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    for key in data:
        if key not in known:
            raise UnknownNameError(f"key of [{name}]", key, known)
    try:
        # Strict parsing takes strings for enums and lists for tuples from JSON only.
        return TypeAdapter(kind).validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as error:
        raise _first_error(name, error) from None


def _first_error(name: str, error: ValidationError) -> InvalidValueError:
    first = error.errors()[0]
    own = first.get("ctx", {}).get("error")
    if isinstance(own, InvalidValueError):
        return InvalidValueError(f"{name}.{own.name}", own.value, own.allowed)
    key = ".".join([name, *(str(part) for part in first["loc"][:1])])
    message = first["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
    return InvalidValueError(key, first["input"], message)
