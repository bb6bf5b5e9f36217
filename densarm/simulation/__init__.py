"""Simulation: plants, and the fixed-step loop that closes a controller around them."""

from densarm.simulation.fixed_step_loop import (
    FixedStepLoop,
    LoopEnd,
    Recording,
    SimulationParameters,
)
from densarm.simulation.plant import Integrator, PinocchioPlant, Plant
from densarm.simulation.single_integrator import SingleIntegrator

__all__ = [
    "FixedStepLoop",
    "Integrator",
    "LoopEnd",
    "PinocchioPlant",
    "Plant",
    "Recording",
    "SimulationParameters",
    "SingleIntegrator",
]
