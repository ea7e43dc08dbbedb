"""Unknown-input observers: their errors obey bounds whatever the channels of w are that T = I - E C cancels."""
