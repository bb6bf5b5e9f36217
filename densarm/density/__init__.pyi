"""The public names of densarm.density, which itself reads them here."""

from .goal_distance import EuclideanDistance as EuclideanDistance
from .goal_distance import ProductDistance as ProductDistance
from .goal_distance import TorusDistance as TorusDistance
from .joint_space_cover import JointSpaceCover as JointSpaceCover
from .navigation_density import NavigationDensity as NavigationDensity
from .pose_distance import PoseDistance as PoseDistance
from .unsafe_sets import ClearanceSet as ClearanceSet
from .unsafe_sets import ImplicitSet as ImplicitSet
from .unsafe_sets import JointLimitSet as JointLimitSet

__all__: list[str]
