"""Colours and opacities of a stage, alike on the page and in pictures."""

Color = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""

BOARD: Color = (0.85, 0.81, 0.78)
OBSTACLE: Color = (0.83, 0.47, 0.30)
EDGE: Color = (0.45, 0.22, 0.12)
SENSING: Color = (0.93, 0.69, 0.13)
GOAL: Color = (0.16, 0.62, 0.43)
CLOSEST: Color = (0.85, 0.05, 0.45)
FLOOR: Color = (0.78, 0.81, 0.85)
TEXT: Color = (0.11, 0.15, 0.20)
GOOD: Color = (0.12, 0.48, 0.30)
BAD: Color = (0.70, 0.15, 0.12)
QUIET: Color = (0.89, 0.91, 0.93)

OBSTACLE_OPACITY = 0.45
SENSING_OPACITY = 0.18
GOAL_OPACITY = 0.45


def css(color: Color) -> str:
    """Return a colour as style sheets write it."""
    return "#" + "".join(f"{round(255 * part):02x}" for part in color)


def hexadecimal(color: Color) -> int:
    """Return a colour as three.js has it."""
    return int(css(color)[1:], 16)
