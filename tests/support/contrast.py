"""Contrast of colours (WCAG 2.2), and the colours of figures in a dark colour scheme."""

from collections.abc import Sequence

#: Least contrast of a line with its background (WCAG 2.2, 1.4.11).
LINE_CONTRAST = 3.0

#: Background of reports and cards of the page in a dark colour scheme, the lighter one.
DARK_PAPER = (0x17, 0x1F, 0x24)

#: Matrix of ``hue-rotate(180deg)`` (Filter Effects Module Level 1).
_HALF_TURN = ((-0.574, 1.43, 0.144), (0.426, 0.43, 0.144), (0.426, 1.43, -0.856))


def contrast(one: Sequence[float], other: Sequence[float]) -> float:
    """Return the contrast of two colours with channels from 0 to 255."""
    dark, light = sorted((_luminance(one), _luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def shown_in_dark(colour: Sequence[float], paper: Sequence[float] = DARK_PAPER) -> tuple[float, ...]:
    """Return a colour of a figure after ``invert(1) hue-rotate(180deg)``, as a screen on a dark paper."""
    inverted = [255 - each for each in colour]
    turned = [sum(a * b for a, b in zip(row, inverted, strict=True)) for row in _HALF_TURN]
    clipped = [min(255.0, max(0.0, each)) for each in turned]
    return tuple(255 - (255 - a) * (255 - b) / 255 for a, b in zip(clipped, paper, strict=True))


def _luminance(colour: Sequence[float]) -> float:
    parts = [each / 255 for each in colour]
    red, green, blue = (p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue
