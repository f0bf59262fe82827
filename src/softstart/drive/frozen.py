"""A pydantic model that is a value: frozen, equal by content, hashable, copied and pickled as such."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, field_serializer

from softstart.errors import InputError
from softstart.quantities import show

__all__ = ["FrozenModel"]


class FrozenModel(BaseModel):
    """Base of `Drive`: every way in goes through the constructor, which alone words what is wrong.

    Fields may be read-only arrays. A subclass raises `InputError`, never pydantic's own error.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    def given(self) -> dict[str, Any]:
        """The parameters that were given, in the order of the fields; the others have their defaults."""
        return {
            name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set
        }

    @classmethod
    def model_validate(cls, obj: Any, **_options: Any) -> Self:
        """The same as calling the class with the items of `obj`."""
        if isinstance(obj, cls):
            return obj
        if not isinstance(obj, Mapping):
            raise InputError(f"{show(obj)}: a table of parameters is needed to make a {cls.__name__}.")
        return cls(**{str(name): value for name, value in obj.items()})

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with changes, which are checked."""
        return type(self)(**(self.given() | dict(update or {})))

    @field_serializer("*", when_used="json")
    def _as_list(self, value: object) -> object:
        return value.tolist() if isinstance(value, np.ndarray) else value

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self._content() == other._content()

    def __hash__(self) -> int:
        return hash(self._content())

    def _content(self) -> tuple[object, ...]:
        return tuple((v.shape, v.tobytes()) if isinstance(v, np.ndarray) else v for _, v in self)

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self.given().items())})"
        )

    __str__ = __repr__

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> Self:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (type(self), self.given())

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(
            f"a {type(self).__name__} cannot be changed; make another with replace({name}=...)"
        )

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"a {type(self).__name__} cannot be changed")


def _rebuilt(cls: type[FrozenModel], given: dict[str, Any]) -> FrozenModel:
    return cls(**given)
