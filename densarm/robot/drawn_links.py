"""Links that a URDF draws: which of them it gives no collision geometry, and what they take."""

import xml.etree.ElementTree as ElementTree
from copy import deepcopy
from enum import StrEnum


class CollisionFromVisual(StrEnum):
    """Which links collide as they are drawn."""

    NEVER = "never"
    """None: those without collision geometry touch nothing."""
    MISSING = "missing"
    """Those that are drawn and have no collision geometry."""
    ALWAYS = "always"
    """All that are drawn: their collision geometry gives way."""


def links_without_collision(root: ElementTree.Element) -> tuple[str, ...]:
    """Return the names of the links that are drawn and have no collision geometry.

    Args:
        root: the URDF.
    """
    return tuple(link.get("name", "") for link in _drawn(root) if link.find("collision") is None)


def collide_as_drawn(root: ElementTree.Element, which: CollisionFromVisual) -> None:
    """Give links their visual geometry as collision geometry.

    Args:
        root: the URDF; changed.
        which: of its links.
    """
    for link in _drawn(root):
        own = link.findall("collision")
        if which == CollisionFromVisual.NEVER or (own and which == CollisionFromVisual.MISSING):
            continue
        for element in own:
            link.remove(element)
        for visual in link.findall("visual"):
            collision = deepcopy(visual)
            collision.tag = "collision"
            link.append(collision)


def _drawn(root: ElementTree.Element) -> list[ElementTree.Element]:
    return [link for link in root.findall("link") if link.find("visual") is not None]
