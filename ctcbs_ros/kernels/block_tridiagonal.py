"""Linear systems of 3 x 3 blocks, block-tridiagonal: what an implicit step of a cable solves.

Row i of the system is lower[i] x[i-1] + diagonal[i] x[i] + upper[i] x[i+1] = b[i]. Gauss's
elimination from the first row to the last, with no exchange of rows: an implicit step's matrix is
the mass, which dominates, plus positive multiples of damping and stiffness.
"""


from ctcbs_ros.kernels.compiled import fused_kernel


@fused_kernel
def factorise(lower, diagonal, upper):
    """Factorise in place: diagonal[i] becomes the inverse pivot, upper[i] that times upper[i].

    Parameters
    ----------
    lower, diagonal, upper : (n, 3, 3) arrays
        Those of the first row's `lower` and of the last row's `upper` are not used.
    """
    n = diagonal.shape[0]
    for i in range(n):
        d = diagonal[i]
        if i > 0:
            low, up = lower[i], upper[i - 1]
            for a in range(3):
                for b in range(3):
                    d[a, b] -= low[a, 0] * up[0, b] + low[a, 1] * up[1, b] + low[a, 2] * up[2, b]
        d00, d01, d02 = d[0, 0], d[0, 1], d[0, 2]
        d10, d11, d12 = d[1, 0], d[1, 1], d[1, 2]
        d20, d21, d22 = d[2, 0], d[2, 1], d[2, 2]
        c00 = d11 * d22 - d12 * d21
        c10 = d12 * d20 - d10 * d22
        c20 = d10 * d21 - d11 * d20
        per = 1.0 / (d00 * c00 + d01 * c10 + d02 * c20)
        d[0, 0], d[1, 0], d[2, 0] = c00 * per, c10 * per, c20 * per
        d[0, 1] = (d02 * d21 - d01 * d22) * per
        d[1, 1] = (d00 * d22 - d02 * d20) * per
        d[2, 1] = (d01 * d20 - d00 * d21) * per
        d[0, 2] = (d01 * d12 - d02 * d11) * per
        d[1, 2] = (d02 * d10 - d00 * d12) * per
        d[2, 2] = (d00 * d11 - d01 * d10) * per
        if i < n - 1:
            up = upper[i]
            for b in range(3):
                u0, u1, u2 = up[0, b], up[1, b], up[2, b]
                for a in range(3):
                    up[a, b] = d[a, 0] * u0 + d[a, 1] * u1 + d[a, 2] * u2


@fused_kernel
def solve(lower, inverse, upper, x):
    """Replace the right-hand side x, (n, 3), by the solution.

    lower, inverse, upper : (n, 3, 3), as `factorise` leaves them.
    """
    n = inverse.shape[0]
    p0, p1, p2 = 0.0, 0.0, 0.0
    for i in range(n):
        b0, b1, b2 = x[i, 0], x[i, 1], x[i, 2]
        if i > 0:
            low = lower[i]
            b0 -= low[0, 0] * p0 + low[0, 1] * p1 + low[0, 2] * p2
            b1 -= low[1, 0] * p0 + low[1, 1] * p1 + low[1, 2] * p2
            b2 -= low[2, 0] * p0 + low[2, 1] * p1 + low[2, 2] * p2
        d = inverse[i]
        p0 = d[0, 0] * b0 + d[0, 1] * b1 + d[0, 2] * b2
        p1 = d[1, 0] * b0 + d[1, 1] * b1 + d[1, 2] * b2
        p2 = d[2, 0] * b0 + d[2, 1] * b1 + d[2, 2] * b2
        x[i, 0], x[i, 1], x[i, 2] = p0, p1, p2
    for i in range(n - 2, -1, -1):
        up = upper[i]
        q0, q1, q2 = x[i + 1, 0], x[i + 1, 1], x[i + 1, 2]
        x[i, 0] -= up[0, 0] * q0 + up[0, 1] * q1 + up[0, 2] * q2
        x[i, 1] -= up[1, 0] * q0 + up[1, 1] * q1 + up[1, 2] * q2
        x[i, 2] -= up[2, 0] * q0 + up[2, 1] * q1 + up[2, 2] * q2
