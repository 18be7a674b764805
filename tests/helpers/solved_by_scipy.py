"""What is asked of scipy's integrators: they give up rather than go on for ever, as they may beside an event."""

MOST = 20_000
"""Evaluations of all forces; what is asked takes half of them."""


class GivesUp(Exception):
    """The integrator needs more than its evaluations."""


def counted(slope, most=None):
    """The slope of an equation of motion; the integrator gives up after `most` evaluations."""
    left = iter(range(MOST if most is None else most))

    def one(*args):
        if next(left, None) is None:
            raise GivesUp
        return slope(*args)

    return one
