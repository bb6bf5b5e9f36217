"""The public names of densarm.euclidean, which itself reads them here."""

from .density import EuclideanDensity as EuclideanDensity
from .fields import NavigationFunction as NavigationFunction
from .fields import PotentialField as PotentialField
from .fields import saturate as saturate
from .implicit import ImplicitFunction as ImplicitFunction
from .implicit import Placed as Placed
from .implicit import UnsafeRegion as UnsafeRegion
from .integral_curves import CurveParameters as CurveParameters
from .integral_curves import IntegralCurves as IntegralCurves
from .runs import PointRuns as PointRuns
from .runs import run_points as run_points
from .shapes import Ball as Ball
from .shapes import Egg as Egg
from .shapes import Ellipsoid as Ellipsoid
from .shapes import PNormBall as PNormBall

__all__: list[str]
