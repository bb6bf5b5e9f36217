"""Ways to make a certified run fail a part of its certificate, each sure to fail it."""

from tampering import claim, file, obstruction, record, tube
from tampering.kind import Kind, NotPossibleError

__all__ = ["KINDS", "Kind", "NotPossibleError"]

KINDS = {
    "one position changed": Kind("replay", record.position),
    "one velocity changed": Kind("replay", record.velocity),
    "one torque changed": Kind("replay", record.torque),
    "torques shifted in time": Kind("replay", record.shifted_torque),
    "sample skipped": Kind("replay", record.skipped_sample),
    "sample repeated": Kind("replay", record.repeated_sample),
    "teleport": Kind("replay", record.teleport),
    "joints swapped": Kind("replay", record.swapped_joints),
    "one time stamp changed": Kind("start", record.time_stamp),
    "time scaled": Kind("start", record.time_scale),
    "another time step": Kind("replay", claim.time_step),
    "another integrator": Kind("replay", claim.integrator),
    "another mass": Kind("replay", claim.mass),
    "base tilted": Kind("replay", claim.tilted_base),
    "start moved": Kind("start", claim.start_moved),
    "goal moved": Kind("goal", claim.goal_moved),
    "starts in motion": Kind("start", claim.starts_in_motion),
    "ends in motion": Kind("goal", claim.ends_in_motion),
    "torque limit lowered": Kind("limits", claim.weaker),
    "velocity limit lowered": Kind("limits", claim.slower),
    "acceleration limit lowered": Kind("limits", claim.gentler),
    "position limit narrowed": Kind("limits", claim.narrower),
    "obstacle on the way": Kind("swept", obstruction.obstacle_on_the_way),
    "obstacle moved": Kind("swept", obstruction.obstacle_moved),
    "obstacle enlarged": Kind("swept", obstruction.obstacle_enlarged),
    "obstacle between samples": Kind("swept", obstruction.obstacle_between_samples),
    "stop blocked": Kind("stopping", obstruction.blocked_stop),
    "entry not finite": Kind("file", file.not_finite),
    "row missing": Kind("file", file.missing_row),
    "mesh changed": Kind("file", file.other_mesh),
    "tube widened": Kind("tube", tube.widened),
    "one joint's tube widened": Kind("tube", tube.joint_widened),
    "tube of no width": Kind("tube", tube.not_a_tube),
    "obstacle in the tube": Kind("tube", tube.obstacle_inside),
    "obstacle at a stop in it": Kind("tube", tube.obstacle_at_stop),
    "reference shifted": Kind("tube", tube.reference_shifted),
    "one reference changed": Kind("tube", tube.reference_bent),
    "reference late": Kind("tube", tube.reference_late),
    "run outside its tube": Kind("tube", tube.run_astray),
    "reference or tube damaged": Kind("file", tube.damaged),
}
"""All ways, by name."""
