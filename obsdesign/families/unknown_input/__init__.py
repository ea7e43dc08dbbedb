"""Unknown-input observers: the error is independent of the channels of w that T = I - E C takes out of the plant."""
