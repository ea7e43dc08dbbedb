"""The model of an estimation problem: plant, disturbance, what is assumed of f, and what the structure decides."""
