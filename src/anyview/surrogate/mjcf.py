"""Small pieces of MJCF, MuJoCo's XML."""

from collections.abc import Sequence


def numbers(*values: float) -> str:
    """Values as an attribute holds them."""
    return " ".join(f"{value:.5g}" for value in values)


def rgba(rgb: Sequence[float]) -> str:
    """The attribute of an opaque colour."""
    return f'rgba="{numbers(*rgb)} 1"'


def geom(kind: str, size: Sequence[float], at: Sequence[float], look: str, **more: str) -> str:
    """A geom; ``look`` is its ``rgba`` or ``material`` attribute, ``more`` are further attributes."""
    extra = "".join(f' {key}="{value}"' for key, value in more.items())
    return f'<geom type="{kind}" size="{numbers(*size)}" pos="{numbers(*at)}" {look}{extra}/>'
