"""Union-find: which things are one when pairs of them are united."""

from __future__ import annotations

import numpy as np

from gcvec.kernels import kernel


@kernel
def join(parent, a, b):
    """Unite the sets of `a` and `b`, in place: `parent` `(n,)` leads from each element to the least of its
    set, which is its own parent."""
    while parent[a] != a:
        parent[a] = parent[parent[a]]
        a = parent[a]
    while parent[b] != b:
        parent[b] = parent[parent[b]]
        b = parent[b]
    parent[max(a, b)] = min(a, b)


@kernel
def set_numbers(parent):
    """The set `(n,)` of each element, numbered from 0 in the order of their least elements."""
    number = np.empty_like(parent)
    found = 0
    for k in range(len(parent)):
        # A parent comes before its children.
        if parent[k] == k:
            number[k] = found
            found += 1
        else:
            number[k] = number[parent[k]]
    return number


@kernel
def united(first, second, n):
    """The set `(n,)` of each of n things, numbered from 0 in the order of their least members, when these
    pairs are united."""
    parent = np.arange(n)
    for k in range(len(first)):
        join(parent, first[k], second[k])
    return set_numbers(parent)
