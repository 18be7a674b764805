"""Independent solvers, random scenes and fixtures that several tests use."""
