"""The confidence interval of a rate."""

from auditor.identification.cross_validation import wilson


def wilson_percent(k: int, n: int) -> tuple[float, float]:
    """Both ends, in percent, of Wilson's 95 % interval of k out of n."""
    low, high = wilson(k, n)
    return 100 * low, 100 * high
