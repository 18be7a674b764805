"""``python -m granular`` is the `granular` command."""

from granular.app.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
