"""A periodic box that changes, by a barostat or by another fix."""
