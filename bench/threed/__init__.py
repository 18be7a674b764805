"""Soft and hard spheres in three dimensions, to calibrate `gr.contacts`."""
