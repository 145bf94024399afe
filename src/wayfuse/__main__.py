"""``python -m wayfuse`` is the command ``wayfuse``."""

from wayfuse.cli.main import main

if __name__ == "__main__":
    main()
