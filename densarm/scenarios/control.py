"""ControlParameters: which controller drives a scenario's arm, and what its guide is asked for."""

from dataclasses import dataclass
from enum import StrEnum

from densarm.density.goal_distance import KAPPA_MIN
from densarm.errors import InvalidValueError
from densarm.planning.plan import GUIDES, PATH_MARGIN, PLANNING_ALPHA
from densarm.values.checks import non_negative, one_of, positive


class ControlForm(StrEnum):
    """Which density controller drives the arm."""

    TRACKING = "tracking"
    """Along the timed trajectory of the planning system, [ZNV] eq. 17."""
    REGULATION = "regulation"
    """To the goal by way of the sub-goals, [ZNV] eq. 17 with constant q_d."""
    PLAIN = "plain"
    """u = ∇ρ + d(q, q̇)."""
    VELOCITY = "velocity"
    """Along the timed trajectory by commanded velocities, which needs no masses of the arm. Those
    held for several time steps jump beyond the acceleration limits, which is not certified."""


@dataclass(frozen=True)
class ControlParameters:
    """Which controller, and the guide it follows.

    Raises:
        InvalidValueError: a value out of its range.
    """

    form: ControlForm = ControlForm.TRACKING
    """The controller."""
    guide: str = "auto"
    """The guide, unless the caller names another: "auto", "density", "direct" or "path"."""
    margin: float = 0.0
    """Safety margin m: a pair is unsafe at this distance and below [m]."""
    path_margin: float = PATH_MARGIN
    """Distance that paths keep beyond m, less in narrow spaces and near start and goal [m]."""
    kappa: float = 1.0
    """κ of the goal distance, between product and sum; the plain form has the sum."""
    passive_speed: float | None = None
    """Passive safety in tracking: the arm rests before anything that moves, up to this speed [m/s],
    can reach it, and evades nothing; None for evasion."""
    planning_alpha: float = PLANNING_ALPHA
    """α of the planning system where its curve is tracked."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "form", ControlForm(one_of("form", self.form, list(ControlForm))))
        one_of("guide", self.guide, GUIDES)
        non_negative("margin", self.margin)
        non_negative("path_margin", self.path_margin)
        positive("planning_alpha", self.planning_alpha)
        if self.passive_speed is not None:
            positive("passive_speed", self.passive_speed)
            if self.form != ControlForm.TRACKING:
                allowed = f"left out, or form 'tracking', not {str(self.form)!r}"
                raise InvalidValueError("passive_speed", self.passive_speed, allowed)
        if not self.kappa >= KAPPA_MIN:
            raise InvalidValueError("kappa", self.kappa, f"a number >= {KAPPA_MIN}, or infinity")
