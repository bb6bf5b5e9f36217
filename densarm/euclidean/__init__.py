"""The density on Rⁿ of [ZNV] III and IV, and the figures of the paper that no arm is in.

The stub beside this file lists what is public here: the density with its weights, the sets and
shapes that it is made of, what it is compared with, and the bound of [ZNV] eq. 13-14. Every name
is imported when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
