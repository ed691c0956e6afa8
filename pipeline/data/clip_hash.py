"""Near-copies of clips by what is seen: a hash a frame, and sequences of hashes laid over each other.

**Hash of a frame** (after the DCT hash of Zauner 2010): grey, averaged down to 32 x 32, cosine transform,
the signs of the 8 x 8 coefficients without the first row and column. Signs do not know brightness or
contrast, and in a mirrored picture exactly those of odd horizontal frequency flip, so a mirrored clip is
found by one XOR. A frame with next to no contrast has the hash 0 and is left out of every comparison.

**Distance of two clips**: hashes are taken at 5 Hz; one sequence is shifted over the other by up to 5 s,
and the smallest mean Hamming distance (0 to 64 bits) over at least half of the shorter clip counts.

**Threshold** 16 bits, from the demo's 14 clips (640x360, 5 to 7 s, several cut back to back from one
drive) and 13 changed copies of each; mean distance, worst of 14:

    x264 crf 35              2.2    trimmed by 7 frames      11.0
    320x180, crf 32          2.2    13 off, 20 off the end    9.7
    160x90, crf 30           2.6    trimmed by 40 frames      0.8
    crf 45                   5.2    12.5 instead of 25 fps    3.4
    40 levels brighter       4.2    cut by 16 px all round   10.2
    contrast x 0.6           1.2    logo of 100 x 30 px      12.8
    mirrored, crf 28         0.8 once the mirror is undone
    two different clips     20.2 and more (91 pairs; median without a shift 31.2)

Comparing 20,000 clips made of the demo's hashes (bits flipped per clip, noise per frame, 198 planted
copies) took 8 s of processor time on one core, and found all 198 and no other pair.

A camera that stands still before one scene gives clips that look alike to this hash: a near-copy is
something to look at, not a proof.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

Grey: TypeAlias = NDArray[np.uint8]  # (H, W)
Hashes: TypeAlias = NDArray[np.uint64]  # (n,)

RATE_HZ = 5
MAX_SHIFT_S = 5.0
THRESHOLD_BITS = 16.0
MAX_HASHES = 600  # of a clip: two minutes
MIN_OVERLAP = 3  # frames that must be compared, besides half of the shorter clip
FLAT_LEVELS = 2.0  # a standard deviation of grey below this shows nothing

_SIDE = 32
_PROBES = (0.25, 0.5, 0.75)  # of a clip's length: what the first, coarse look compares
_COARSE_BITS = 20  # mean of the probes; looser than the threshold, since a probe is one frame
_UNKNOWN_BITS = 32  # what a flat or missing frame counts in the coarse look: chance
_MEAN_COSINE = (
    0.45  # of the mean bits: the demo's copies have 0.51 (a logo) and 0.8 to 1, other clips up to 0.54
)
_BLOCK = 256  # clips compared with all others at a time

# Signs of odd horizontal frequency (1, 3, 5, 7), which a mirror flips, in the order of the bits.
MIRROR = np.packbits(np.tile([True, False] * 4, 8)).view(np.uint64)[0]


def frame_hash(grey: Grey) -> int:
    """The 64-bit hash of a grey picture of any size; 0 when it is flat."""
    small = cv2.resize(grey, (_SIDE, _SIDE), interpolation=cv2.INTER_AREA).astype(np.float32)
    if float(small.std()) < FLAT_LEVELS:
        return 0
    signs = cv2.dct(small)[1:9, 1:9] > 0
    return int(np.packbits(signs.ravel()).view(np.uint64)[0])


@dataclass(frozen=True, slots=True)
class NearCopy:
    """Two clips that show the same: mean distance in bits, and where the second begins in the first.

    `shift_s` is the time in `first` at which `second` begins, negative when it begins before.
    """

    first: str
    second: str
    distance_bits: float
    shift_s: float
    mirrored: bool


def distance(first: Hashes, second: Hashes, max_shift_s: float = MAX_SHIFT_S) -> tuple[float, int]:
    """The smallest mean distance in bits, and the shift in hashes; (64.0, 0) when nothing is comparable."""
    reach = round(max_shift_s * RATE_HZ)
    best = (64.0, 0)
    for shift in sorted(range(-reach, reach + 1), key=abs):
        a, b = first[max(0, shift) :], second[max(0, -shift) :]
        n = min(len(a), len(b))
        seen = (a[:n] != 0) & (b[:n] != 0)
        count = int(seen.sum())
        if count < MIN_OVERLAP or 2 * count < min(len(first), len(second)):
            continue
        bits = int(np.bitwise_count(a[:n] ^ b[:n])[seen].sum()) / count
        if bits < best[0]:
            best = (bits, shift)
    return best


def near_copies(
    clips: Mapping[str, Sequence[int]],
    threshold_bits: float = THRESHOLD_BITS,
    max_shift_s: float = MAX_SHIFT_S,
) -> list[NearCopy]:
    """Pairs of clips (id -> hashes) that are at most `threshold_bits` apart, mirrored ones included.

    Of a group of copies only as many pairs are given as tie it together. A coarse look at three frames of
    each clip finds the candidates, all of them in NumPy; the exact distance decides. Sorted by ids.
    """
    usable = {name: np.asarray(found, np.uint64) for name, found in clips.items() if any(found)}
    order = sorted(usable, key=lambda name: (len(usable[name]), name))  # the shorter clip has the probes
    groups = Groups(order)
    pairs = []
    for a, b, mirrored in _candidates([usable[name] for name in order], max_shift_s):
        if groups.root(order[a]) == groups.root(order[b]):
            continue
        first, second = sorted((order[a], order[b]))
        mask = MIRROR if mirrored else np.uint64(0)
        looked = usable[first]
        bits, shift = distance(np.where(looked != 0, looked ^ mask, looked), usable[second], max_shift_s)
        if bits <= threshold_bits:
            groups.join(first, second)
            pairs.append(NearCopy(first, second, round(bits, 1), shift / RATE_HZ, mirrored))
    return sorted(pairs, key=lambda pair: (pair.first, pair.second))


def _candidates(clips: Sequence[Hashes], max_shift_s: float) -> Iterator[tuple[int, int, bool]]:
    """(place, later place, whether mirrored) of clips, sorted by length, that look alike at first sight.

    First the mean of each clip's bits over time, all clips with all, then three frames at every shift.
    """
    if not clips:
        return
    reach = round(max_shift_s * RATE_HZ)
    lengths = np.array([len(hashes) for hashes in clips])
    padded = np.zeros((len(clips), int(lengths.max()) + 2 * reach), np.uint64)
    for place, hashes in enumerate(clips):
        padded[place, reach : reach + len(hashes)] = hashes
    for mask in (np.uint64(0), MIRROR):
        means = np.array([_mean_bits(hashes, np.uint64(0)) for hashes in clips])
        turned = np.array([_mean_bits(hashes, mask) for hashes in clips])
        for low in range(0, len(clips), _BLOCK):
            found = np.argwhere(turned[low : low + _BLOCK] @ means[low:].T >= _MEAN_COSINE)
            found = found[found[:, 0] < found[:, 1]] + low
            alike = _probed(padded, lengths, found, reach, mask)
            yield from ((a, b, bool(mask)) for a, b in found[alike].tolist())


def _mean_bits(hashes: Hashes, mask: np.uint64) -> NDArray[np.float32]:
    """The bits as -1 and 1, averaged over the frames that are not flat, as a unit vector of 64."""
    seen = hashes[hashes != 0] ^ mask
    mean = np.unpackbits(seen[:, None].view(np.uint8), axis=1).mean(axis=0, dtype=np.float64) * 2 - 1
    length = float(np.linalg.norm(mean))
    return np.asarray(mean / length if length else mean, np.float32)


def _probed(
    padded: NDArray[np.uint64],
    lengths: NDArray[np.int64],
    pairs: NDArray[np.int64],
    reach: int,
    mask: np.uint64,
) -> NDArray[np.bool_]:
    """Which pairs (rows of `padded`, the shorter clip first) have probes that agree at some shift."""
    short, long = pairs[:, 0], pairs[:, 1]
    best = np.full(len(pairs), _UNKNOWN_BITS * len(_PROBES), np.uint8)
    places = [(lengths[short] * share).astype(np.int64) + reach for share in _PROBES]
    probes = [padded[short, place] for place in places]
    for shift in range(-reach, reach + 1):
        total = np.zeros(len(pairs), np.uint8)
        for place, probe in zip(places, probes, strict=True):
            field = padded[long, place + shift]
            bits = np.bitwise_count(probe ^ mask ^ field)
            total += np.where((probe == 0) | (field == 0), _UNKNOWN_BITS, bits).astype(np.uint8)
        np.minimum(best, total, out=best)
    return np.asarray(best <= _COARSE_BITS * len(_PROBES))


class Groups:
    """Names that belong together, by joining two at a time."""

    def __init__(self, names: Iterable[str]) -> None:
        """Each name alone."""
        self._parent = {name: name for name in names}

    def root(self, name: str) -> str:
        """The name that stands for the group."""
        while self._parent[name] != name:
            self._parent[name] = self._parent[self._parent[name]]
            name = self._parent[name]
        return name

    def join(self, first: str, second: str) -> None:
        """Make one group of two; the smaller name stands for it."""
        low, high = sorted((self.root(first), self.root(second)))
        self._parent[high] = low

    def sets(self) -> list[tuple[str, ...]]:
        """The groups of two and more, sorted."""
        found: dict[str, list[str]] = {}
        for name in sorted(self._parent):
            found.setdefault(self.root(name), []).append(name)
        return [tuple(names) for _, names in sorted(found.items()) if len(names) > 1]
