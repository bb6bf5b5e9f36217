"""The density on Rⁿ of [ZNV] III and IV, and the figures of the paper that no arm is in."""
