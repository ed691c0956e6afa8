"""Records kept as columns: a million of them are a few arrays, and each is made only when asked for."""

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, Self, TypeVar, overload

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

R = TypeVar("R")

_MADE_AT_ONCE = 4_096


class Columns(Sequence[R], Generic[R]):
    """A sequence of records over columns, sorted by the key of their table; it never changes.

    It equals any tuple or other `Columns` with the same records, and a slice of it is a tuple.
    """

    __slots__ = ()

    @abstractmethod
    def made(self, start: int, stop: int) -> list[R]:
        """The records from `start` to before `stop`, both within the length."""

    @abstractmethod
    def arrays(self, start: int, stop: int) -> list[pa.Array]:
        """The same rows as Arrow arrays, one for each column of the table, in its order."""

    @overload
    def __getitem__(self, place: int) -> R: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[R, ...]: ...
    def __getitem__(self, place: int | slice) -> R | tuple[R, ...]:
        """One record, or those of a slice. Raises IndexError as a tuple does."""
        if isinstance(place, slice):
            start, stop, step = place.indices(len(self))
            if step == 1:
                return tuple(self.made(start, max(start, stop)))
            return tuple(self[one] for one in range(start, stop, step))
        number = place + len(self) if place < 0 else place
        if not 0 <= number < len(self):
            raise IndexError(f"no record {place} among {len(self)}")
        return self.made(number, number + 1)[0]

    def __iter__(self) -> Iterator[R]:
        """The records in order, made a few thousand at a time."""
        for start in range(0, len(self), _MADE_AT_ONCE):
            yield from self.made(start, min(start + _MADE_AT_ONCE, len(self)))

    def __eq__(self, other: object) -> bool:
        """Whether the other is a tuple or columns of equal records."""
        if self is other:
            return True
        if not isinstance(other, tuple | Columns):
            return NotImplemented
        return len(self) == len(other) and all(a == b for a, b in zip(self, other, strict=True))

    def __hash__(self) -> int:
        """That of the tuple of the records."""
        return hash(tuple(self))

    def __repr__(self) -> str:
        """The first records, as in a tuple, and how many there are."""
        shown = ", ".join(map(repr, self[:3]))
        more = f", ... {len(self):,} in all" if len(self) > 3 else ""
        return f"{type(self).__name__}({shown}{more})"


@dataclass(frozen=True, slots=True, eq=False)
class Coded:
    """A column of P values as numbers: `codes` (P,) are places in `values`, texts or lists.

    Texts are distinct, and each is used; lists may be equal, or not used.
    """

    codes: NDArray[np.int32]
    values: pa.Array

    @classmethod
    def of(cls, values: Iterable[object], kind: pa.DataType) -> Self:
        """Of hashable values, which Arrow can keep as `kind`."""
        number: dict[object, int] = {}
        codes = np.fromiter((number.setdefault(value, len(number)) for value in values), dtype=np.int32)
        return cls(codes, pa.array(list(number), kind))

    @classmethod
    def same(cls, value: object, count: int, kind: pa.DataType) -> Self:
        """One value `count` times."""
        return cls(np.zeros(count, dtype=np.int32), pa.array([value] if count else [], kind))

    def ordered(self, order: NDArray[np.int64]) -> Self:
        """The same values in another order."""
        return type(self)(self.codes[order], self.values)

    def array(self, start: int, stop: int) -> pa.Array:
        """The values from `start` to before `stop`."""
        part = self.values.take(pa.array(self.codes[start:stop]))
        return _plain_lists(part) if pa.types.is_list(part.type) else part


def _plain_lists(lists: pa.ListArray) -> pa.ListArray:
    """Lists of texts that are kept as a dictionary, as lists of the texts."""
    if not pa.types.is_dictionary(lists.type.value_type):
        return lists
    lengths = np.asarray(lists.value_lengths())
    offsets = np.concatenate(([0], np.cumsum(lengths))).astype(np.int32)
    return pa.ListArray.from_arrays(pa.array(offsets), lists.flatten().dictionary_decode())
