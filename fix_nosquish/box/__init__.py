"""The periodic box where it changes, by a barostat or by another fix."""
