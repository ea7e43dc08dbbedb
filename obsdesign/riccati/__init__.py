"""The dissipation inequality of large plants: the gain is eliminated, and P solves one Riccati equation."""
