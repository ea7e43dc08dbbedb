"""What f itself says of its type: enclosures of its Jacobian that prove it, pairs of points that refute it."""
