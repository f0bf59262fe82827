"""What a sweep says in a few numbers, read piece by piece so that its size does not matter."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.start.status import Status
from softstart.sweeping.grid import ChunkGrid

if TYPE_CHECKING:
    import xarray

SHARES = {"q05": 0.05, "q50": 0.5, "q95": 0.95}
READ_AT_ONCE = 1 << 20  # starts: of so many a figure takes 8 MiB of memory
MOST_FOR_QUANTILES = 1 << 27  # values of a figure from which quantiles are taken: 1 GiB


@dataclass(frozen=True)
class Summary:
    """Starts by status, the spread of each figure, and the place on the grid where `judged` is largest."""

    starts: int
    statuses: Mapping[str, int]
    spreads: Mapping[str, Mapping[str, float]]
    judged: str
    worst: Mapping[str, float | str]

    @property
    def share_reached(self) -> float:
        """Share of the starts that brought the load to its target speed, or of the duties carried out."""
        good = (status.name for status in Status if status.success)
        return sum(self.statuses.get(name, 0) for name in good) / self.starts

    @property
    def share_kept(self) -> float | None:
        """Share of the starts that keep the limits; None where that was not computed."""
        kept = self.spreads.get("keeps_limits")
        if (kept := self.spreads.get("keeps_limits")) is None:
            return None
        return (kept["mean"] * kept["count"] if kept["count"] else 0.0) / self.starts

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "starts": self.starts,
            "status": dict(self.statuses),
            "share_reached": self.share_reached,
            **({} if self.share_kept is None else {"share_keeping_limits": self.share_kept}),
            "figures": dict(self.spreads),
            "worst": {"figure": self.judged, "at": dict(self.worst)},
        }


def summarise(results: xarray.Dataset) -> Summary:
    """The numbers of a sweep, as `sweep` returns it or `xarray.open_zarr` opens it.

    >>> from softstart import Drive, sweep
    >>> found = summarise(sweep(Drive.load("crane-4amtkf"), "direct", {"gap": [0.5, 2.0]}))
    >>> found.share_reached, found.worst, round(found.spreads["k_dyn"]["max"], 4)
    (1.0, {'gap': 2.0}, 4.8654)
    """
    starts = results["status"].size
    codes = np.zeros(len(Status) + 1, dtype=np.int64)
    for _, piece in pieces(results, "status"):
        codes += np.bincount(1 + piece.ravel(), minlength=codes.size)  # NOT_COMPUTED is -1
    names = ["NOT_COMPUTED", *(status.name for status in Status)]
    statuses = {name: int(count) for name, count in zip(names, codes, strict=True) if count}
    figures = [str(name) for name in results.data_vars if name != "status"]
    thin = -(-starts // MOST_FOR_QUANTILES)
    spreads = {name: spread((piece for _, piece in pieces(results, name)), thin) for name in figures}
    judged = "k_dyn" if "k_dyn" in figures else next(iter(figures), "")
    return Summary(starts, statuses, spreads, judged, worst_place(results, judged) if judged else {})


def pieces(results: xarray.Dataset, name: str) -> Iterator[tuple[tuple[slice, ...], Any]]:
    """A figure in pieces that fit into memory: places on the grid, and the values there."""
    shape = results[name].shape
    chunk = results[name].encoding.get("chunks") or ChunkGrid.of(shape, [False] * len(shape)).chunk
    plan = ChunkGrid(shape, chunk)
    plan = replace(plan, chunk=shape) if plan.starts <= READ_AT_ONCE else plan
    return ((place, results[name][place].values) for place in map(plan.place, plan.indices()))


def spread(parts: Iterable[Any], thin: int = 1) -> dict[str, float]:
    """Of values in parts, NaN left out: how many, least, 5 %, 50 % and 95 % quantile, mean and most.

    A quantile is a value that occurs. Of more values than memory holds, each `thin`-th in the order of each
    part stands for its neighbours.

    >>> spread([np.array([3.0, 1.0]), np.array([2.0, np.nan])])["q50"]
    2.0
    """
    count, total, least, most, kept = 0, [0.0], math.inf, -math.inf, [np.empty(0)]
    for part in parts:
        good = part[~np.isnan(part)]
        if good.size:
            count += good.size
            total.append(float(good.sum()))
            least, most = min(least, float(good.min())), max(most, float(good.max()))
            kept.append(good if thin == 1 else np.sort(good)[min(thin // 2, good.size - 1) :: thin])
    if not count:
        return {"count": 0} | dict.fromkeys(("min", *SHARES, "mean", "max"), math.nan)
    values = np.quantile(np.concatenate(kept), list(SHARES.values()), method="inverted_cdf").tolist()
    quantiles = dict(zip(SHARES, values, strict=True))
    return {"count": count, "min": least, **quantiles, "mean": math.fsum(total) / count, "max": most}


def worst_place(results: xarray.Dataset, name: str) -> dict[str, float | str]:
    """The coordinates of the largest value; the first one of several."""
    best, where = -math.inf, {}
    for place, piece in pieces(results, name):
        if not np.isnan(piece).all() and (most := float(np.nanmax(piece))) > best:
            best = most
            index = np.unravel_index(int(np.nanargmax(piece)), piece.shape)
            each = zip(results[name].dims, place, index, strict=True)
            where = {dim: part.start + int(i) for dim, part, i in each}
    return {
        str(key): float(value) if value.dtype.kind in "fiu" else str(value.item())
        for key, value in (results[name].isel(where).coords.items() if where else ())
    }
