"""Riccati equations of linear plants in several hundred digits, which decide where doubles may not."""

from flint import acb_mat, arb, arb_mat, ctx

FAINT = 1e-50  # noise on states and outputs, of the size of v: without it a mode that nothing reaches is on the axis


class Plant:
    """x' = A x + B w, y = C x + D w, z = H e; entries are doubles, taken as they are."""

    def __init__(self, A, B, C, D, H, bits=600):
        self.bits = ctx.prec = bits
        self.A, self.B, self.C, self.D, self.H = map(exact, (A, B, C, D, H))
        self.n, self.size = len(A), max(*(abs(float(x)) for row in B for x in row), 1e-300)

    def storage(self, rate, weight, supply):
        """X = P^-1 of the largest P of V' + 2 rate V + weight |z|^2 <= supply |v|^2 over all gains; None if none."""
        ctx.prec = self.bits
        n, one = self.n, arb(1)
        noise = arb(FAINT * self.size) ** 2
        R = (self.D * self.D.transpose() + unit(self.C.nrows()) * noise) * (one / supply)
        back = middle(R.inv())
        across = self.B * self.D.transpose() * (one / supply)
        A = middle(self.A + unit(n) * arb(rate) - across * back * self.C)
        G = (self.B * self.B.transpose() + unit(n) * noise) * (one / supply) - across * back * across.transpose()
        Q = self.H.transpose() * self.H * arb(weight) - self.C.transpose() * back * self.C
        return stable(A, middle(G), middle(Q))

    def reaches(self, gamma, alpha):
        """Whether |z|_2 <= gamma |v|_2 at the rate alpha for some gain: l2."""
        X = self.storage(alpha, 1, arb(gamma) ** 2)
        return X is not None and positive(X)

    def peak(self, alpha):
        """Least gamma of linf."""
        X = self.storage(alpha, 0, 2 * arb(alpha))
        values = acb_mat(self.H * X * self.H.transpose()).eig(algorithm="approx")
        return max(float(value.real.mid()) for value in values) ** 0.5


def exact(M):
    """Matrix of the doubles."""
    return arb_mat([[arb(float(x)) for x in row] for row in M])


def unit(n):
    """Identity."""
    return arb_mat([[arb(int(i == j)) for j in range(n)] for i in range(n)])


def middle(M):
    """Midpoints of intervals."""
    return arb_mat(M.nrows(), M.ncols(), [x.mid() for x in M.entries()])


def stable(A, G, Q):
    """X of A X + X A' + X Q X + G = 0 with A + X Q stable; None where eigenvalues are on the axis."""
    n = A.nrows()
    H = [[*A.transpose().table()[i], *Q.table()[i]] for i in range(n)]
    H += [[*(-x for x in G.table()[i]), *(-x for x in A.table()[i])] for i in range(n)]
    values, vectors = acb_mat(arb_mat(H)).eig(right=True, algorithm="approx")
    chosen = [k for k, value in enumerate(values) if value.real.mid() < 0]
    near = arb(2) ** (-ctx.prec // 5)
    if len(chosen) != n or any(abs(value.real.mid()) <= near * abs(value.mid()) for value in values):
        return None
    Z1, Z2 = (acb_mat([[vectors[row + i, k].mid() for k in chosen] for i in range(n)]) for row in (0, n))
    X = Z2 * acb_mat(n, n, [x.mid() for x in Z1.inv().entries()])
    return arb_mat([[((X[i, j] + X[j, i]) / 2).real.mid() for j in range(n)] for i in range(n)])


def positive(X):
    """Whether Gauss's pivots are positive."""
    M, n = X.table(), X.nrows()
    for k in range(n):
        if not M[k][k] > 0:
            return False
        for i in range(k + 1, n):
            share = (M[i][k] / M[k][k]).mid()
            for j in range(k, n):
                M[i][j] = (M[i][j] - share * M[k][j]).mid()
    return True
