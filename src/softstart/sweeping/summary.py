"""What a sweep says in a few numbers, read piece by piece so that its size does not matter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.start.status import Status
from softstart.sweeping.grid import Plan, plan_for
from softstart.sweeping.results import NOT_COMPUTED, STATUS

if TYPE_CHECKING:
    import xarray

SHARES = (0.05, 0.5, 0.95)
Pieces = Callable[[], Iterator[Any]]
READ_WHOLE = 1 << 20  # starts: of so many a figure takes 8 MiB of memory


@dataclass(frozen=True)
class Spread:
    """A figure over all starts that have one: least, mean, most, and what shares of them do not exceed."""

    count: int
    least: float
    quantiles: Mapping[float, float]
    mean: float
    most: float

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        named = {f"q{round(100 * share):02d}": value for share, value in self.quantiles.items()}
        return {"count": self.count, "min": self.least, **named, "mean": self.mean, "max": self.most}


@dataclass(frozen=True)
class Summary:
    """Starts by status, the spread of each figure, and the place on the grid where `judged` is largest."""

    starts: int
    statuses: Mapping[str, int]
    spreads: Mapping[str, Spread]
    judged: str
    worst: Mapping[str, float | str]

    @property
    def share_reached(self) -> float:
        """Share of the starts that brought the load to its target speed."""
        return self.statuses.get(Status.REACHED.name, 0) / self.starts

    @property
    def share_kept(self) -> float | None:
        """Share of the starts that keep the limits; None where that was not computed."""
        kept = self.spreads.get("keeps_limits")
        return None if kept is None else (kept.mean * kept.count if kept.count else 0.0) / self.starts

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "starts": self.starts,
            "status": dict(self.statuses),
            "share_reached": self.share_reached,
            **({} if self.share_kept is None else {"share_keeping_limits": self.share_kept}),
            "figures": {name: spread.summary() for name, spread in self.spreads.items()},
            "worst": {"figure": self.judged, "at": dict(self.worst)},
        }


def summarise(results: xarray.Dataset) -> Summary:
    """The numbers of a sweep, as `sweep` returns it or `xarray.open_zarr` opens it.

    >>> from softstart import Drive, sweep
    >>> found = summarise(sweep(Drive.load("crane-4amtkf"), "direct", {"gap": [0.5, 2.0]}))
    >>> found.share_reached, found.worst, round(found.spreads["k_dyn"].most, 4)
    (1.0, {'gap': 2.0}, 4.8654)
    """
    plan = plan_of(results)
    codes = np.zeros(len(Status) + 1, dtype=np.int64)
    for piece in _pieces(results, STATUS, plan)():
        codes += np.bincount(piece.ravel() - NOT_COMPUTED, minlength=codes.size)
    names = ["NOT_COMPUTED", *(status.name for status in Status)]
    statuses = {name: int(count) for name, count in zip(names, codes, strict=True) if count}
    figures = [str(name) for name in results.data_vars if name != STATUS]
    spreads = {name: spread(_pieces(results, name, plan)) for name in figures}
    judged = "k_dyn" if "k_dyn" in figures else next(iter(figures), "")
    return Summary(plan.starts, statuses, spreads, judged, _worst(results, judged, plan) if judged else {})


def plan_of(results: xarray.Dataset) -> Plan:
    """The chunks in which results are best read."""
    shape = tuple(results[STATUS].shape)
    chunk = results.attrs.get("softstart_chunk")
    if chunk is None or len(chunk) != len(shape):
        return plan_for(shape, [False] * len(shape))
    return Plan(shape, tuple(int(step) for step in chunk))


def _pieces(results: xarray.Dataset, name: str, plan: Plan) -> Pieces:
    """Chunk by chunk, several times over; what is small is read once and as a whole."""
    whole = results[name].values if plan.starts <= READ_WHOLE else None

    def pieces() -> Iterator[Any]:
        for place in map(plan.place, range(plan.chunks)):
            yield results[name][place].values if whole is None else whole[place]

    return pieces


def spread(pieces: Pieces, shares: Sequence[float] = SHARES) -> Spread:
    """Exact, whatever the size; NaN is left out. A quantile is a value that occurs.

    >>> spread(lambda: iter([np.array([3.0, 1.0]), np.array([2.0, np.nan])]), [0.5]).quantiles
    {0.5: 2.0}
    """
    count, total, least, most = 0, [0.0], math.inf, -math.inf
    for piece in pieces():
        good = piece[~np.isnan(piece)]
        if good.size:
            count += good.size
            total.append(float(good.sum()))
            least, most = min(least, float(good.min())), max(most, float(good.max()))
    if not count:
        return Spread(0, math.nan, dict.fromkeys(shares, math.nan), math.nan, math.nan)
    ranks = [max(0, math.ceil(share * count) - 1) for share in shares]
    found = dict(zip(shares, _ranked(pieces, ranks), strict=True))
    return Spread(count, least, found, math.fsum(total) / count, most)


def _ranked(pieces: Pieces, ranks: Sequence[int]) -> list[float]:
    """The values at these places of the sorted whole, found 16 bits at a time: four passes, little memory."""
    prefixes, left = [0] * len(ranks), list(ranks)
    for shift in (48, 32, 16, 0):
        counts = {prefix: np.zeros(1 << 16, dtype=np.int64) for prefix in prefixes}
        for piece in pieces():
            keys = _keys(piece[~np.isnan(piece)])
            for prefix in counts:
                same = keys if shift == 48 else keys[(keys >> np.uint64(shift + 16)) == np.uint64(prefix)]
                digits = (same >> np.uint64(shift)) & np.uint64(0xFFFF)
                counts[prefix] += np.bincount(digits.astype(np.int64), minlength=1 << 16)
        for index, prefix in enumerate(prefixes):
            below = np.cumsum(counts[prefix])
            digit = int(np.searchsorted(below, left[index], side="right"))
            left[index] -= int(below[digit - 1]) if digit else 0
            prefixes[index] = (prefix << 16) | digit
    return [_value(prefix) for prefix in prefixes]


SIGN = 1 << 63


def _keys(values: Any) -> Any:
    """Whole numbers in the order of the float64 values."""
    bits = np.ascontiguousarray(values, dtype=np.float64).ravel().view(np.uint64)
    return np.where(bits >= np.uint64(SIGN), ~bits, bits | np.uint64(SIGN))


def _value(key: int) -> float:
    bits = key ^ SIGN if key & SIGN else key ^ ((1 << 64) - 1)
    return float(np.array([bits], dtype=np.uint64).view(np.float64)[0])


def _worst(results: xarray.Dataset, name: str, plan: Plan) -> dict[str, float | str]:
    """The coordinates of the largest value; the first one of several."""
    best, where = -math.inf, None
    for number, piece in enumerate(_pieces(results, name, plan)()):
        place = plan.place(number)
        if not np.isnan(piece).all() and (most := float(np.nanmax(piece))) > best:
            best = most
            index = np.unravel_index(int(np.nanargmax(piece)), piece.shape)
            where = {
                dim: part.start + int(i)
                for dim, part, i in zip(results[name].dims, place, index, strict=True)
            }
    if where is None:
        return {}
    coordinates = results[name].isel(where).coords
    return {
        str(key): float(value) if value.dtype.kind in "fiu" else str(value.item())
        for key, value in coordinates.items()
    }
