"""Navigation densities: inverse bumps, unsafe sets, goal distances, and the field they make.

The stub beside this file lists what is public here, beside `densarm` itself: what ρ of an arm can
be made of. Every name is imported when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
