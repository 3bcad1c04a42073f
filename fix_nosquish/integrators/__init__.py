"""The integrators that a fix line names: thermostats and barostats."""
