"""Measurements of the package: tables and figures of the docs, ratios, and the study of stiff and extreme cases."""
