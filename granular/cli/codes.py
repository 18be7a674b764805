"""Exit codes of the `granular` command."""

OK, MISUSE, ABNORMAL, INTERRUPTED = 0, 2, 3, 130
