"""Guides: chains of sub-goals that lead the density from a start to a goal."""

from densarm.guides.direct import DirectGuide
from densarm.guides.guide import FreeSpace, Guide, GuidePath, NoPath
from densarm.guides.path import PathGuide, PathGuideParameters

__all__ = [
    "DirectGuide",
    "FreeSpace",
    "Guide",
    "GuidePath",
    "NoPath",
    "PathGuide",
    "PathGuideParameters",
]
