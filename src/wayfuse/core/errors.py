"""Errors of bad *use*: each names what is wrong, where, and what to do about it.

Bad *data* never raises: it gets a verdict and a counter (`wayfuse.sensors.quality`). The command line turns every
`WayfuseError` into one line without a traceback.
"""

from __future__ import annotations

__all__ = [
    "ConfigError",
    "DataMissingError",
    "FormatError",
    "MapError",
    "RadioMapError",
    "UsageError",
    "WayfuseError",
]


class WayfuseError(Exception):
    """Base of all errors a user can cause and mend.

    Parameters
    ----------
    what : the fault, naming the field or option.
    where : file, or file and line, or option; empty where it is plain.
    remedy : what the user can do.
    """

    def __init__(self, what: str, *, where: object = "", remedy: str = "") -> None:
        self.what, self.where, self.remedy = what, str(where), remedy
        super().__init__(self.__str__())

    def __str__(self) -> str:
        text = f"{self.where}: {self.what}" if self.where else self.what
        return f"{text} ({self.remedy})" if self.remedy else text


class FormatError(WayfuseError):
    """A file is not of the format it is read as."""


class DataMissingError(WayfuseError):
    """A file or data set is not there; wayfuse never invents a stand-in."""


class MapError(WayfuseError):
    """A site cannot be built, read or used."""


class RadioMapError(WayfuseError):
    """A survey or radio map cannot be built, read or used."""


class ConfigError(WayfuseError):
    """A parameter is outside its range."""


class UsageError(WayfuseError):
    """A command or function is called in a way that cannot work."""
