"""Soft and hard spheres in three dimensions, for the calibration of `gr.contacts`."""
