"""Connected components."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def root_of(first: wp.array(dtype=wp.int32), node: int):
    """The first node that is known to hang together with this one; the ways of those in between become shorter."""
    at = int(node)
    while first[at] != at:
        first[at] = first[first[at]]
        at = first[at]
    return at


@wp.kernel
def label_joined(
    a: wp.array(dtype=wp.int32),
    b: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    label: wp.array(dtype=wp.int32),
):
    """The connected component of each of some nodes that are joined by the pairs a-b, numbered by their first nodes.

    One thread: a union hangs the later root on the earlier one (Tarjan 1975), so that each node hangs on one whose label is there before.
    """
    for i in range(label.shape[0]):
        label[i] = i
    for k in range(a.shape[0]):
        if a[k] != b[k]:
            i = root_of(label, a[k])
            j = root_of(label, b[k])
            label[wp.max(i, j)] = wp.min(i, j)
    count = int(0)
    for i in range(label.shape[0]):
        if label[i] == i:
            label[i] = count
            count += 1
        else:
            label[i] = label[label[i]]
