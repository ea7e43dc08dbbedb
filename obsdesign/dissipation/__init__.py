"""What the observers that are copies of the plant share: one dissipation inequality, its proof, its gains."""
