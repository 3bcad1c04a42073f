"""The integrators of the fix styles, with their thermostats and barostats."""
