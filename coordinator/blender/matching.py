"""Finds the places of a mesh on the triangles of a lit one. Needs no Blender.

The baker divides triangles, doubles vertices and drops those that light does not need, but never leaves the plane of a triangle: each
place of the input lies on a lit triangle that faces the same way.
"""

import numpy as np

# Triangles of a leaf of the tree.
LEAF = 64
# Cosine between what faces the same way.
AGREEING = 0.7
# Part of the way from a corner to the middle of its triangle: so far inside there is one side of an edge only.
INWARD = 1e-3
# Part of the extent of a mesh by which two places may differ.
TOLERANCE = 1e-4


def normals(triangles):
    """Returns the unit normals (t, 3) of triangles (t, 3, 3); zero where there is no area."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return np.divide(across, length, out=np.zeros_like(across, dtype=float), where=length > 0)


def weights(triangles, points):
    """Returns the barycentric coordinates (n, 3) of points (n, 3) in triangles (n, 3, 3), by pairs; zero where there is no area."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    to = points - triangles[:, 0]
    aa, ab, bb = (np.einsum("ij,ij->i", u, v) for u, v in ((first, first), (first, second), (second, second)))
    pa, pb = (np.einsum("ij,ij->i", to, u) for u in (first, second))
    area = aa * bb - ab * ab
    safe = np.where(area > 0, area, 1)
    second, third = (bb * pa - ab * pb) / safe, (aa * pb - ab * pa) / safe
    return np.where(area[:, None] > 0, np.stack([1 - second - third, second, third], axis=1), 0)


def locate(triangles, points, directions, tolerance):
    """Finds on which triangle each point lies.

    `triangles` (t, 3, 3), `points` (n, 3), unit normals `directions` (n, 3) of the points' surfaces, `tolerance` a distance, all in
    one system of axes. Returns the nearest triangle (n,) that faces the same way, -1 where none is within the tolerance.
    """
    triangles, points = np.asarray(triangles, float), np.asarray(points, float)
    facing = normals(triangles)
    low, high = triangles.min(axis=1) - tolerance, triangles.max(axis=1) + tolerance
    found = np.full(len(points), -1)
    nearest = np.full(len(points), np.inf)

    def leaf(members, queries):
        at = points[queries][:, None]
        fit = ((at >= low[members]) & (at <= high[members])).all(axis=2)
        fit &= directions[queries] @ facing[members].T > AGREEING
        first, second = np.nonzero(fit)
        query, member = queries[first], members[second]
        inside = np.clip(weights(triangles[member], points[query]), 0, None)
        inside /= np.maximum(inside.sum(axis=1, keepdims=True), 1e-30)
        closest = np.einsum("ij,ijk->ik", inside, triangles[member])
        distance = np.linalg.norm(closest - points[query], axis=1)
        near = distance <= np.minimum(tolerance, nearest[query])
        # Of several, what is written last stays.
        order = np.flatnonzero(near)[np.argsort(-distance[near], kind="stable")]
        nearest[query[order]], found[query[order]] = distance[order], member[order]

    # The halves of a node, until few triangles are left; each takes the points within its box.
    pending = [(np.arange(len(triangles)), np.arange(len(points)))]
    while pending:
        members, queries = pending.pop()
        if not len(members) or not len(queries):
            continue
        least, most = low[members].min(axis=0), high[members].max(axis=0)
        queries = queries[((points[queries] >= least) & (points[queries] <= most)).all(axis=1)]
        if len(members) <= LEAF:
            leaf(members, queries)
            continue
        middles = low[members] + high[members]
        half = len(members) // 2
        order = np.argpartition(middles[:, np.argmax(most - least)], half)
        pending += [(members[order[:half]], queries), (members[order[half:]], queries)]
    return found


def reach(positions):
    """Returns the distance within which places of a mesh with these positions (n, 3) or (n, 3, 3) are the same."""
    positions = np.asarray(positions).reshape(-1, 3)
    extent = np.ptp(positions, axis=0).max() if len(positions) else 0
    return TOLERANCE * max(float(extent), 1e-9)


def values_at_corners(own, corners, count, lit, values):
    """Takes values of lit triangles over to the corners of a mesh's faces.

    `own` (f, 3, 3) are the mesh's triangles, `corners` (f, 3) the corner of a face that each of theirs is, of `count` in all; `lit`
    (t, 3, 3) and `values` (t, 3, w) are the lit ones. Returns values (count, w), and of which corners (count,) there is light.
    """
    own, first = np.asarray(own, float), _first_places(corners, count)
    triangle, place = np.divmod(first, 3)
    at = own[triangle, place]
    middle = own.mean(axis=1)[triangle]
    inward = at + INWARD * (middle - at)
    found = locate(lit, inward, normals(own)[triangle], reach(own))
    has_light = found >= 0
    result = np.zeros((count, values.shape[2]))
    inside = np.clip(weights(np.asarray(lit, float)[found[has_light]], inward[has_light]), 0, None)
    inside /= np.maximum(inside.sum(axis=1, keepdims=True), 1e-30)
    result[has_light] = np.einsum("ij,ijk->ik", inside, values[found[has_light]])
    return result, has_light


def coordinates_at_corners(own, corners, count, lit, coordinates):
    """Takes texture coordinates of lit triangles over to the corners of a mesh's faces.

    As [values_at_corners], with coordinates (t, 3, 2), which are linear on each face: a triangle that lies on part of a lit one, or
    holds it, has those of its whole plane. Returns coordinates (count, 2), of which corners (count,) there are any, and the lit
    triangle (f,) of each own one, -1 where there is none.
    """
    own, lit = np.asarray(own, float), np.asarray(lit, float)
    found = locate(lit, own.mean(axis=1), normals(own), reach(own))
    triangle, place = np.divmod(_first_places(corners, count, found >= 0), 3)
    on = found[triangle]
    has_any = on >= 0
    result = np.zeros((count, 2))
    inside = weights(lit[on[has_any]], own[triangle, place][has_any])
    result[has_any] = np.einsum("ij,ijk->ik", inside, coordinates[on[has_any]])
    return result, has_any, found


def _first_places(corners, count, preferred=None):
    """Returns, of each corner of faces, the place in `corners` (f, 3), flat, of one triangle that has it: a preferred one if any."""
    flat = np.asarray(corners).ravel()
    order = np.arange(len(flat))[::-1]
    if preferred is not None:
        # What is written last stays.
        order = order[np.argsort(np.repeat(preferred, 3)[order], kind="stable")]
    first = np.zeros(count, int)
    first[flat[order]] = order
    return first
