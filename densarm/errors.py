"""Errors in the user's words: what was wrong, its value, what is allowed, how to mend it."""

from collections.abc import Iterable
from difflib import get_close_matches


class DensarmError(ValueError):
    """Base of every error that densarm raises about its input; its message is one line."""


class UnknownNameError(DensarmError):
    """A name that nothing carries.

    Args:
        kind: what the name should stand for, e.g. ``"robot"``.
        name: the name given.
        known: the names that exist.
    """

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        names = sorted(known)
        close = get_close_matches(str(name), names, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        listed = ", ".join(names) or "none"
        super().__init__(f"unknown {kind} {str(name)!r}{hint} (known: {listed})")


class InvalidValueError(DensarmError):
    """A value outside what is allowed.

    Args:
        name: the argument or key.
        value: what was given.
        allowed: what is allowed, as a phrase that follows "must be".
    """

    def __init__(self, name: str, value: object, allowed: str) -> None:
        self.name, self.value, self.allowed = name, value, allowed
        super().__init__(f"{name} = {_short(value)}: must be {allowed}")


class RobotDescriptionError(DensarmError):
    """A URDF or SRDF that cannot be used, with the reason."""


class SceneChangedError(DensarmError):
    """Something computed for obstacles that have since moved, come or gone."""

    def __init__(self) -> None:
        super().__init__(
            "the obstacles have changed since this was computed: compute it anew from the clearance"
        )


class RobotError(DensarmError):
    """A robot that cannot be reached or driven, or that stopped by itself, in its own words."""


class FileContentError(DensarmError):
    """A file that is not what its reader expects.

    Args:
        path: the file.
        reason: what is wrong with it.
    """

    def __init__(self, path: object, reason: str) -> None:
        super().__init__(f"{path}: {reason}")


def _short(value: object) -> str:
    plain = value.tolist() if hasattr(value, "tolist") else value  # numpy's own
    text = " ".join(repr(plain).split())
    return text if len(text) <= 80 else text[:77] + "..."
