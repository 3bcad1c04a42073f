"""The integrators that a fix line names, and their thermostats and barostats."""
