"""Step length from the shape of a step: constant, Weinberg, Kim, Kakiuchi and a linear regression."""

from __future__ import annotations

from dataclasses import dataclass

from wayfuse.core.errors import ConfigError

__all__ = ["DEFAULT", "MODELS", "StepLengthModel"]

MODELS = ("constant", "weinberg", "kim", "kakiuchi", "regression")


@dataclass(frozen=True, slots=True)
class StepLengthModel:
    """A step-length model and its coefficients."""

    name: str = "constant"
    coefficients: tuple[float, ...] = (0.69,)

    def __post_init__(self) -> None:
        if self.name not in MODELS:
            raise ConfigError(
                f"step-length model {self.name!r} is not known", remedy=f"one of {', '.join(MODELS)}"
            )

    @property
    def code(self) -> float:
        """Number by which the kernels know the model."""
        return float(MODELS.index(self.name))


DEFAULT = StepLengthModel()
