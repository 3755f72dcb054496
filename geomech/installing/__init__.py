"""Building of the installable package, and checks of the installation (`doctor`)."""
