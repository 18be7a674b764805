"""Run the `granular` command by ``python -m granular``."""

from granular.app.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
