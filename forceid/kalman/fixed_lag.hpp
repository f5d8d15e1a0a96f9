// One step of a filter with the fixed-point smoothers of the frames that are pending: written in numpy in
// recursions/fixed_lag.py, step for step the same. Row-major doubles.

namespace {
namespace fixed_lag {

using namespace lanes;

typedef double Loose __attribute__((vector_size(LANES * 8), may_alias, aligned(8))); // wherever it begins

INLINE Size padded(Size n) { return (n + LANES - 1) / LANES * LANES; }

// ROWS rows of WIDTH registers of y = x a, rows of a and of y `wide`: they stay in registers
template <int ROWS, int WIDTH>
INLINE void multiply_tile(const double *x, Size x_apart, const double *a, double *y, Size m, Size wide) {
  Lanes sum[ROWS][WIDTH];
#pragma GCC unroll 8
  for (int i = 0; i < ROWS; ++i)
#pragma GCC unroll 8
    for (int j = 0; j < WIDTH; ++j) sum[i][j] = Lanes{};
  for (const double *row = a, *end = a + m * wide; row != end; row += wide, ++x) {
    Lanes from[WIDTH];
#pragma GCC unroll 8
    for (int j = 0; j < WIDTH; ++j) from[j] = *reinterpret_cast<const Loose *>(row + j * LANES);
#pragma GCC unroll 8
    for (int i = 0; i < ROWS; ++i) {
      const Lanes f = all(x[i * x_apart]);
#pragma GCC unroll 8
      for (int j = 0; j < WIDTH; ++j) sum[i][j] += f * from[j];
    }
  }
#pragma GCC unroll 8
  for (int i = 0; i < ROWS; ++i)
#pragma GCC unroll 8
    for (int j = 0; j < WIDTH; ++j) *reinterpret_cast<Loose *>(y + i * wide + j * LANES) = sum[i][j];
}

template <int ROWS>
INLINE void multiply_rows(const double *x, Size x_apart, const double *a, double *y, Size m, Size wide) {
  Size j = 0;
  for (; j + 2 * LANES <= wide; j += 2 * LANES) multiply_tile<ROWS, 2>(x, x_apart, a + j, y + j, m, wide);
  if (j < wide) multiply_tile<ROWS, 1>(x, x_apart, a + j, y + j, m, wide);
}

// y (rows, wide) = x (rows, m), rows x_apart from each other, times a (m, wide), wide a multiple of LANES
INLINE void multiply(const double *x, Size x_apart, const double *a, double *y, Size rows, Size m, Size wide) {
  Size i = 0;
  for (; i + 4 <= rows; i += 4) multiply_rows<4>(x + i * x_apart, x_apart, a, y + i * wide, m, wide);
  for (; i < rows; ++i) multiply_rows<1>(x + i * x_apart, x_apart, a, y + i * wide, m, wide);
}

// Inverse of a symmetric 3 by 3 matrix.
INLINE void invert(const double *a, double *z) {
  z[0] = a[4] * a[8] - a[5] * a[7], z[1] = a[2] * a[7] - a[1] * a[8], z[2] = a[1] * a[5] - a[2] * a[4];
  z[3] = a[5] * a[6] - a[3] * a[8], z[4] = a[0] * a[8] - a[2] * a[6], z[5] = a[2] * a[3] - a[0] * a[5];
  z[6] = a[3] * a[7] - a[4] * a[6], z[7] = a[1] * a[6] - a[0] * a[7], z[8] = a[0] * a[4] - a[1] * a[3];
  const double d = 1.0 / (a[0] * z[0] + a[1] * z[3] + a[2] * z[6]);
  for (int i = 0; i < 9; ++i) z[i] *= d;
}

Followed follow(Array P_, Array gain_, Array R_, Array y_, Array C_, Array var_, Array F_, Array Q_, Array x_,
                Array rows_, Array z_, Array noise_, double most) {
  const Size n = x_.shape(0), m = rows_.shape(0), p = y_.size();
  const bool closed_loop = gain_.size() > 0, seen = z_.size() > 0;
  Out P2({n, n}), C2({p + m, n}), y2({p + m}), var2({p + m}), x2({n});
  Out none({0, 3});
  // F, closed by the gain of the frame before; all matrices with rows of `wide`, zero beyond n
  const Size wide = padded(n), few = padded(3);
  static thread_local Buffer memory;
  memory.resize((3 * n + std::max(p, n) + 3) * wide + (2 * few + 3) * n);
  double *closed = memory.data(), *turned = closed + n * wide, *work = turned + n * wide;
  double *further = work + n * wide, *own = further + std::max(p, n) * wide;
  double *through = own + 3 * wide, *gained = through + n * few, *spread = gained + n * few;
  std::fill(closed, work, 0.0);
  const double *F = F_.data(), *Q = Q_.data(), *K_before = gain_.data();
  if (closed_loop) {
    std::fill(gained, gained + n * few, 0.0);
    for (Size i = 0; i < n; ++i) std::copy(K_before + 3 * i, K_before + 3 * i + 3, gained + i * few);
    multiply(F, n, gained, through, n, n, few);
  } else {
    std::fill(through, through + n * few, 0.0);
  }
  for (Size i = 0; i < n; ++i) {
    const double *by = through + i * few;
    for (int l = 0; l < 3; ++l)
      spread[3 * i + l] = by[0] * R_.data()[l] + by[1] * R_.data()[3 + l] + by[2] * R_.data()[6 + l];
    std::copy(F + i * n, F + i * n + n, closed + i * wide);
    for (int l = 0; l < 3; ++l) closed[i * wide + l] -= by[l];
  }
  for (Size i = 0; i < n; ++i)
    for (Size j = 0; j < n; ++j) turned[j * wide + i] = closed[i * wide + j];
  // P: of the state before the frame
  double *P = P2.data();
  multiply(P_.data(), n, turned, work, n, n, wide);
  multiply(closed, wide, work, further, n, n, wide);
  for (Size i = 0; i < n; ++i) {
    const double *a = spread + 3 * i;
    for (Size j = 0; j <= i; ++j) {
      const double *b = through + j * few, held = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
      const double sum = 0.5 * (further[i * wide + j] + further[j * wide + i]) + Q[i * n + j] + held;
      P[i * n + j] = P[j * n + i] = work[i * wide + j] = work[j * wide + i] = sum;
    }
  }
  // what is pending, and the frame itself
  double *C = C2.data(), *y = y2.data(), *var = var2.data(), *x = x2.data();
  const double *rows = rows_.data();
  multiply(C_.data(), n, turned, further, p, n, wide);
  for (Size i = 0; i < p; ++i) std::copy(further + i * wide, further + i * wide + n, C + i * n);
  multiply(rows, n, work, own, m, n, wide);
  for (Size i = 0; i < m; ++i) std::copy(own + i * wide, own + i * wide + n, C + (p + i) * n);
  std::copy(y_.data(), y_.data() + p, y);
  std::copy(var_.data(), var_.data() + p, var);
  std::copy(x_.data(), x_.data() + n, x);
  for (Size i = 0; i < m; ++i) {
    y[p + i] = var[p + i] = 0.0;
    for (Size j = 0; j < n; ++j) {
      y[p + i] += rows[i * n + j] * x[j];
      var[p + i] += rows[i * n + j] * C[(p + i) * n + j];
    }
  }
  if (!seen) return std::make_tuple(x2, P2, none, y2, C2, var2, 0.0);
  double S[9], inverse[9], nu[3], weighed[3], off = 0.0;
  for (int i = 0; i < 3; ++i) {
    nu[i] = z_.data()[i] - x[i];
    for (int j = 0; j < 3; ++j) S[3 * i + j] = P[i * n + j] + noise_.data()[3 * i + j];
  }
  invert(S, inverse);
  for (int i = 0; i < 3; ++i) {
    weighed[i] = inverse[3 * i] * nu[0] + inverse[3 * i + 1] * nu[1] + inverse[3 * i + 2] * nu[2];
    off += nu[i] * weighed[i];
  }
  if (!(off < most)) return std::make_tuple(x2, P2, none, y2, C2, var2, off);
  Out gain({n, 3});
  double *K = gain.data();
  for (Size i = 0; i < p + m; ++i) {
    const double *c = C + i * n;
    y[i] += c[0] * weighed[0] + c[1] * weighed[1] + c[2] * weighed[2];
    for (int a = 0; a < 3; ++a)
      var[i] -= c[a] * (inverse[3 * a] * c[0] + inverse[3 * a + 1] * c[1] + inverse[3 * a + 2] * c[2]);
  }
  for (Size i = 0; i < n; ++i) {
    const double *row = P + i * n;
    x[i] += row[0] * weighed[0] + row[1] * weighed[1] + row[2] * weighed[2];
    for (int a = 0; a < 3; ++a)
      K[3 * i + a] = row[0] * inverse[a] + row[1] * inverse[3 + a] + row[2] * inverse[6 + a];
  }
  return std::make_tuple(x2, P2, gain, y2, C2, var2, off);
}

} // namespace fixed_lag
} // namespace
