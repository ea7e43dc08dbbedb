"""A family of observers as README tells to add one: a Luenberger observer of a linear plant."""
