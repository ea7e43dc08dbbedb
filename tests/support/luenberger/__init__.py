"""A family of observers as the manual tells to add one: a Luenberger observer of a linear plant."""
