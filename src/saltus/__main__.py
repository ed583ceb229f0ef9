"""``python -m saltus``, and the command ``saltus`` itself."""

import sys

from saltus.errors import SaltusError
from saltus.extras import check_installed

__all__ = ["main"]


def main() -> None:
    """Run the command; without the packages that it needs, tell in a line how to install them."""
    try:
        check_installed("typer")
    except SaltusError as error:
        print(f"saltus: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    from saltus import cli

    cli.main()


if __name__ == "__main__":
    main()
