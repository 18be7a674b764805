"""Tests, in one folder per room of the package. See README.md."""
