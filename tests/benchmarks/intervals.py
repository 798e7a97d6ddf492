"""How sure a rate is."""

import math

_Z = 1.959963984540054


def wilson_percent(k: int, n: int) -> tuple[float, float]:
    """Both ends, in percent, of Wilson's 95 % interval of k out of n."""
    p = k / n
    middle, half = p + _Z * _Z / (2 * n), _Z * math.sqrt(p * (1 - p) / n + _Z * _Z / (4 * n * n))
    scale = 1 + _Z * _Z / n
    return 100 * (middle - half) / scale, 100 * (middle + half) / scale
