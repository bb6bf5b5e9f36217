"""Collision-free motion of robot arms by navigation density functions.

Every name is imported when it is first used, so that ``import densarm`` is quick. The stub beside
this file lists them.
"""

from importlib.metadata import PackageNotFoundError, version

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

try:
    __version__ = version("densarm")
except PackageNotFoundError:  # a folder that nobody installed
    __version__ = "0+checkout"
