"""Linear matrix inequalities: written once, probed for a solver, reduced, solved, and proved in rationals."""
