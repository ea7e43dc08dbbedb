"""Lines of a table."""


def proved(_, guarantee):
    """The level and the rate."""
    return [("gamma", f"{guarantee['gamma']:g}"), ("decay rate", f"{guarantee['alpha']:g} 1/s")]


def figures(observer):
    """The gain."""
    return [("L1", str(observer["L1"]))]
