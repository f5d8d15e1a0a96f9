// Polar and bipolar factors of 3 by 3 matrices with det > 0, eight at a time, one in each vector lane.
//
// One-sided Jacobi gives F = L diag(D) R. Its rotation L R is then improved as a quaternion by Newton's rule, with the
// skew part of L^T F in twice the digits, because rounding that part once costs eps s1 / (s2 + s3) of the rotation.
// No product is contracted with a sum into an fma: the errors of sums are taken exactly.
//
// Compiled once for each kind of processor, with registers of REGISTER doubles.

UNCONTRACTED

namespace {
namespace polar {

constexpr int SWEEPS = 20, ROUNDS = 8;
constexpr double ORTHOGONAL = 1e-15; // cosine of two columns that are
constexpr double ARRIVED = 1e-9;     // rad: a step so short leaves its square, and less
using namespace twofold;

INLINE Lanes determinant(const Lanes *F) {
  const auto minor = [&](int i, int j) { return product(F[3 + i], F[6 + j]) - product(F[3 + j], F[6 + i]); };
  return rounded(minor(1, 2) * F[0] + minor(2, 0) * F[1] + minor(0, 1) * F[2]);
}

INLINE Lanes dot(const Lanes *a, const Lanes *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// C = A B of 3 by 3, row by row
INLINE void times(const Lanes *A, const Lanes *B, Lanes *C) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) C[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
}

// Nearest rotation to one that is off by some eps: Newton-Schulz.
INLINE void polish(Lanes *V) {
  Lanes S[9], W[9];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) S[3 * i + j] = (i == j ? 1.5 : 0.0) - 0.5 * dot(V + 3 * i, V + 3 * j);
  times(S, V, W);
  std::copy(W, W + 9, V);
}

// Columns of F by rotations to orthogonal ones. C, V: their rows are these columns and the right factor.
INLINE void jacobi(const Lanes *F, Lanes *C, Lanes *V) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) C[3 * i + j] = F[3 * j + i], V[3 * i + j] = all(i == j);
  for (int sweep = 0; sweep < SWEEPS; ++sweep) {
    Bits turned = {};
    for (int pair = 0; pair < 3; ++pair) {
      Lanes *a = C + (pair == 2 ? 3 : 0), *b = C + (pair == 0 ? 3 : 6);
      Lanes *v = V + (a - C), *w = V + (b - C);
      const Lanes aa = dot(a, a), bb = dot(b, b), ab = dot(a, b);
      const Bits turn = ab * ab > ORTHOGONAL * ORTHOGONAL * aa * bb;
      if (!any(turn)) continue;
      turned |= turn;
      const Lanes zeta = (bb - aa) / (turn ? 2.0 * ab : all(1));
      const Lanes size = 1.0 / (magnitude(zeta) + root(1.0 + zeta * zeta));
      const Lanes t = turn ? (zeta < 0.0 ? -size : size) : all(0);
      const Lanes c = 1.0 / root(1.0 + t * t), s = c * t;
      for (int k = 0; k < 3; ++k) {
        const Lanes ak = a[k], vk = v[k];
        a[k] = c * ak - s * b[k], b[k] = s * ak + c * b[k];
        v[k] = c * vk - s * w[k], w[k] = s * vk + c * w[k];
      }
    }
    if (!any(turned)) break;
  }
}

// F = L diag(D) R with D in descending order; det > 0 known.
INLINE void bipolar(const Lanes *F, const Lanes &det, Lanes *L, Lanes *D, Lanes *R) {
  Lanes C[9];
  jacobi(F, C, R);
  for (int pair = 0; pair < 3; ++pair) { // a proper exchange of rows where the second is longer
    Lanes *a = C + (pair == 1 ? 3 : 0), *b = a + 3;
    Lanes *v = R + (a - C), *w = v + 3;
    const Bits longer = dot(b, b) > dot(a, a);
    for (int k = 0; k < 3; ++k) {
      const Lanes ak = a[k], vk = v[k];
      a[k] = longer ? b[k] : ak, b[k] = longer ? -ak : b[k];
      v[k] = longer ? w[k] : vk, w[k] = longer ? -vk : w[k];
    }
  }
  polish(R);
  D[0] = root(dot(C, C)), D[1] = root(dot(C + 3, C + 3));
  D[2] = det / (D[0] * D[1]);
  Lanes l1[3], l2[3];
  for (int k = 0; k < 3; ++k) l1[k] = C[k] / D[0], l2[k] = C[3 + k] / D[1];
  const Lanes along = dot(l1, l2);
  for (int k = 0; k < 3; ++k) l2[k] -= along * l1[k];
  const Lanes length = 1.0 / root(dot(l2, l2));
  for (int k = 0; k < 3; ++k) l2[k] *= length;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    L[3 * k] = l1[k], L[3 * k + 1] = l2[k], L[3 * k + 2] = l1[i] * l2[j] - l1[j] * l2[i];
  }
}

// Quaternion (w, x, y, z), of some length, of the rotation Q: the longest row of 4 q q^T.
INLINE void quaternion(const Lanes *Q, Lanes *q) {
  const Lanes a = Q[7] - Q[5], b = Q[2] - Q[6], c = Q[3] - Q[1];
  const Lanes d = Q[1] + Q[3], e = Q[2] + Q[6], f = Q[5] + Q[7];
  const Lanes row[4][4] = {{1.0 + Q[0] + Q[4] + Q[8], a, b, c},
                           {a, 1.0 + Q[0] - Q[4] - Q[8], d, e},
                           {b, d, 1.0 - Q[0] + Q[4] - Q[8], f},
                           {c, e, f, 1.0 - Q[0] - Q[4] + Q[8]}};
  Lanes best = row[0][0];
  std::copy(row[0], row[0] + 4, q);
  for (int i = 1; i < 4; ++i) {
    const Bits better = row[i][i] > best;
    for (int k = 0; k < 4; ++k) q[k] = better ? row[i][k] : q[k];
    best = better ? row[i][i] : best;
  }
}

INLINE void rotation(const Lanes *q, Lanes *Q) {
  const Lanes w = q[0], x = q[1], y = q[2], z = q[3], s = 2.0 / (w * w + x * x + y * y + z * z);
  Q[0] = 1.0 - s * (y * y + z * z), Q[1] = s * (x * y - w * z), Q[2] = s * (x * z + w * y);
  Q[3] = s * (x * y + w * z), Q[4] = 1.0 - s * (x * x + z * z), Q[5] = s * (y * z - w * x);
  Q[6] = s * (x * z - w * y), Q[7] = s * (y * z + w * x), Q[8] = 1.0 - s * (x * x + y * y);
}

// The polar rotation Q of F, from one near it: Q exp([theta]x), (tr U I - U) theta = vee(Q^T F - F^T Q).
INLINE void improve(const Lanes *F, Lanes *Q) {
  Lanes q[4];
  quaternion(Q, q);
  Bits moving = ~Bits{};
  for (int round = 0; round < ROUNDS; ++round) {
    const Lanes w = q[0], x = q[1], y = q[2], z = q[3];
    const Twofold ww = product(w, w), xx = product(x, x), yy = product(y, y), zz = product(z, z);
    const Twofold wx = product(w, x), wy = product(w, y), wz = product(w, z);
    const Twofold xy = product(x, y), xz = product(x, z), yz = product(y, z);
    // |q|^2 Q, a polynomial of q: a rotation but for its length, whatever q was rounded to
    const Twofold N[9] = {(ww + xx) - (yy + zz), twice(xy - wz), twice(xz + wy),
                          twice(xy + wz), (ww + yy) - (xx + zz), twice(yz - wx),
                          twice(xz - wy), twice(yz + wx), (ww + zz) - (xx + yy)};
    const auto entry = [&](int i, int j) { return N[i] * F[j] + N[3 + i] * F[3 + j] + N[6 + i] * F[6 + j]; };
    const Lanes a = rounded(entry(2, 1) - entry(1, 2)), b = rounded(entry(0, 2) - entry(2, 0)),
                c = rounded(entry(1, 0) - entry(0, 1));
    Lanes A[9]; // N^T F, once rounded
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        A[3 * i + j] = N[i].high * F[j] + N[3 + i].high * F[3 + j] + N[6 + i].high * F[6 + j];
    const Lanes d = A[4] + A[8], e = A[0] + A[8], f = A[0] + A[4];
    const Lanes g = -0.5 * (A[1] + A[3]), h = -0.5 * (A[2] + A[6]), k = -0.5 * (A[5] + A[7]);
    const Lanes c11 = e * f - k * k, c12 = h * k - g * f, c13 = g * k - h * e;
    const Lanes c22 = d * f - h * h, c23 = g * h - d * k, c33 = d * e - g * g;
    const Lanes half = 0.5 / (d * c11 + g * c12 + h * c13);
    const Lanes t1 = half * (c11 * a + c12 * b + c13 * c), t2 = half * (c12 * a + c22 * b + c23 * c),
                t3 = half * (c13 * a + c23 * b + c33 * c);
    const Lanes next[4] = {w - x * t1 - y * t2 - z * t3, x + w * t1 + y * t3 - z * t2,
                           y + w * t2 + z * t1 - x * t3, z + w * t3 + x * t2 - y * t1};
    for (int i = 0; i < 4; ++i) q[i] = moving ? next[i] : q[i];
    moving &= t1 * t1 + t2 * t2 + t3 * t3 > ARRIVED * ARRIVED;
    if (!any(moving)) break;
  }
  rotation(q, Q);
}

// The matrices from `first` on, over the power of two below their largest entry, and that power.
INLINE void load(const double *F, Size first, Size count, Lanes *out, Lanes &power) {
  const double *at[LANES];
  for (int l = 0; l < LANES; ++l) at[l] = F + 9 * std::min(first + l, count - 1);
  Lanes most = {};
  for (int i = 0; i < 9; ++i) {
    out[i] = gathered(at, i);
    const Lanes size = magnitude(out[i]);
    most = size > most ? size : most;
  }
  power = (Lanes)((Bits)most & (Bits{} + 0x7ff0000000000000));
  power = power > 0.0 ? power : all(1);
  const Lanes scale = 1.0 / power;
  for (int i = 0; i < 9; ++i) out[i] *= scale;
}

INLINE void store(const Lanes *value, int entries, double *to, Size first, Size count) {
  for (int l = 0; l < LANES && first + l < count; ++l)
    for (int i = 0; i < entries; ++i) to[(first + l) * entries + i] = value[i][l];
}

// L, U and whether det > 0, of F (frame, 3, 3); L and U mean nothing where it is not.
Three polar(Array F_) {
  const Size n = F_.shape(0);
  Out L_({n, 3, 3}), U_({n, 3, 3}), det_({n});
  const double *F = F_.data();
  double *L_out = L_.data(), *U_out = U_.data(), *det_out = det_.data();
  for (Size first = 0; first < n; first += LANES) {
    Lanes f[9], L[9], D[3], R[9], Q[9], U[9], power;
    load(F, first, n, f, power);
    const Lanes det = determinant(f);
    bipolar(f, det, L, D, R);
    times(L, R, Q);
    improve(f, Q);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j <= i; ++j) {
        const Lanes one = Q[i] * f[j] + Q[3 + i] * f[3 + j] + Q[6 + i] * f[6 + j];
        const Lanes two = Q[j] * f[i] + Q[3 + j] * f[3 + i] + Q[6 + j] * f[6 + i];
        U[3 * i + j] = U[3 * j + i] = 0.5 * power * (one + two);
      }
    store(Q, 9, L_out, first, n), store(U, 9, U_out, first, n), store(&det, 1, det_out, first, n);
  }
  return std::make_tuple(L_, U_, det_);
}

// L, D, R and the sign of det, of F (frame, 3, 3).
Four bipolar_factors(Array F_) {
  const Size n = F_.shape(0);
  Out L_({n, 3, 3}), D_({n, 3}), R_({n, 3, 3}), det_({n});
  const double *F = F_.data();
  double *L_out = L_.data(), *D_out = D_.data(), *R_out = R_.data(),
         *det_out = det_.data();
  for (Size first = 0; first < n; first += LANES) {
    Lanes f[9], L[9], D[3], R[9], Q[9], Rt[9], power;
    load(F, first, n, f, power);
    const Lanes det = determinant(f);
    bipolar(f, det, L, D, R);
    times(L, R, Q);
    improve(f, Q);
    for (int i = 0; i < 9; ++i) Rt[i] = R[3 * (i % 3) + i / 3];
    times(Q, Rt, L); // the L that makes L R the polar rotation
    for (int i = 0; i < 3; ++i) D[i] *= power;
    store(L, 9, L_out, first, n), store(D, 3, D_out, first, n), store(R, 9, R_out, first, n);
    store(&det, 1, det_out, first, n);
  }
  return std::make_tuple(L_, D_, R_, det_);
}

} // namespace polar
} // namespace

CONTRACTED
