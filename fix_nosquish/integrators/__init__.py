"""The integrators that a fix line names: thermostats, barostats, and the shadow energy."""
