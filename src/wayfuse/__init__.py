"""wayfuse: indoor tracking from Wi-Fi and phone motion sensors on floor plans.

The package is laid out in rooms that import downwards only; `docs/architecture.md` draws them. Importing
``wayfuse`` itself loads nothing heavy.
"""

__version__ = "0.1.0"
__all__ = ["__version__"]
