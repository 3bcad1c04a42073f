"""Loops over arrays that are compiled once: how they are written, compiled and kept."""
