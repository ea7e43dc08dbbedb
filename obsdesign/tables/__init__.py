"""What a terminal shows: designs, runs and constants as text."""
