// Matrices of any size times vectors, a strip of rows at a time in vector registers of REGISTER doubles.

namespace {
namespace strips {

constexpr int WIDE = REGISTER;
constexpr int FEW = 128; // columns of a row whose entries that are not zero are listed: 1.5 kB
template <int LENGTH> struct Register {
  typedef double Vector __attribute__((vector_size(LENGTH * 8)));
  typedef Vector Anywhere __attribute__((aligned(8), may_alias)); // in memory
};
template <int LENGTH> using Vector = typename Register<LENGTH>::Vector;
using Memory = std::vector<double, Aligned<double>>;

template <int LENGTH> INLINE Vector<LENGTH> read(const double *p) {
  return *reinterpret_cast<const typename Register<LENGTH>::Anywhere *>(p);
}
template <int LENGTH> INLINE void write(double *p, const Vector<LENGTH> &v) {
  *reinterpret_cast<typename Register<LENGTH>::Anywhere *>(p) = v;
}

// A matrix (rows, count) by its columns, each padded with zeros to full registers.
struct Columns {
  int rows, count, padded;
  Memory data;

  Columns(const double *a, int rows_, int count_)
      : rows(rows_), count(count_), padded((rows_ + WIDE - 1) / WIDE * WIDE),
        data(padded * std::max(count_, padded), 0.0) {
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < count; ++j) data[j * padded + i] = a[i * count + j];
  }
};

// y += A x of X vectors x, `apart` each from the next, and y, padded; COUNT registers of rows. Of one x the
// columns are shared among several sums, for a chain of additions waits for each.
template <int COUNT, int X>
INLINE void strip(const double *column, int padded, int count, const double *x, Size apart, double *y, Size y_apart) {
  constexpr int SUMS = X > 1 ? 1 : COUNT == 1 ? 4 : 2;
  Vector<WIDE> sum[SUMS][X][COUNT] = {};
  for (int s = 0; s < X; ++s)
    for (int b = 0; b < COUNT; ++b) sum[0][s][b] = read<WIDE>(y + s * y_apart + b * WIDE);
  int j = 0;
  for (; j + SUMS <= count; j += SUMS)
    for (int t = 0; t < SUMS; ++t, column += padded)
      for (int b = 0; b < COUNT; ++b) {
        const Vector<WIDE> c = read<WIDE>(column + b * WIDE);
        for (int s = 0; s < X; ++s) sum[t][s][b] += c * x[s * apart + j + t];
      }
  for (; j < count; ++j, column += padded)
    for (int b = 0; b < COUNT; ++b)
      for (int s = 0; s < X; ++s) sum[0][s][b] += read<WIDE>(column + b * WIDE) * x[s * apart + j];
  for (int s = 0; s < X; ++s)
    for (int b = 0; b < COUNT; ++b) {
      for (int t = 1; t < SUMS; ++t) sum[0][s][b] += sum[t][s][b];
      write<WIDE>(y + s * y_apart + b * WIDE, sum[0][s][b]);
    }
}

template <int X> void all_strips(const Columns &A, const double *x, Size apart, double *y) {
  for (int i = 0; i < A.padded;) {
    const int left = (A.padded - i) / WIDE;
    const double *column = A.data.data() + i;
    if (left >= 4) strip<4, X>(column, A.padded, A.count, x, apart, y + i, A.padded), i += 4 * WIDE;
    else if (left >= 2) strip<2, X>(column, A.padded, A.count, x, apart, y + i, A.padded), i += 2 * WIDE;
    else strip<1, X>(column, A.padded, A.count, x, apart, y + i, A.padded), i += WIDE;
  }
}

// y (samples, padded) += A x of each sample, x `apart` each from the next: what does not wait for the one before
void add_products(const Columns &A, const double *x, Size apart, double *y, Size samples) {
  Size k = 0;
  for (; k + 4 <= samples; k += 4) all_strips<4>(A, x + k * apart, apart, y + k * A.padded);
  for (; k < samples; ++k) all_strips<1>(A, x + k * apart, apart, y + k * A.padded);
}

// Few rows stay in registers, lane by lane; more go through memory.
template <int COUNT> void follow(const Columns &A, double *path, Size samples) {
  if constexpr (COUNT * WIDE <= 8) {
    Vector<WIDE> y[COUNT];
    for (int b = 0; b < COUNT; ++b) y[b] = read<WIDE>(path + b * WIDE);
    for (Size k = 0; k < samples; ++k) {
      path += COUNT * WIDE;
      Vector<WIDE> sum[4][COUNT] = {};
      for (int b = 0; b < COUNT; ++b) sum[0][b] = read<WIDE>(path + b * WIDE);
#pragma GCC unroll 8
      for (int j = 0; j < COUNT * WIDE; ++j)
        for (int b = 0; b < COUNT; ++b)
          sum[j % 4][b] += read<WIDE>(A.data.data() + (j * COUNT + b) * WIDE) * y[j / WIDE][j % WIDE];
      for (int b = 0; b < COUNT; ++b) {
        y[b] = (sum[0][b] + sum[1][b]) + (sum[2][b] + sum[3][b]);
        write<WIDE>(path + b * WIDE, y[b]);
      }
    }
    return;
  }
  for (Size k = 0; k < samples; ++k, path += COUNT * WIDE)
    strip<COUNT, 1>(A.data.data(), COUNT * WIDE, A.count, path, 0, path + COUNT * WIDE, 0);
}

// path (1 + samples, padded) holds a start and inputs b; on return path_k = A path_{k-1} + b_k
void follow(const Columns &A, double *path, Size samples) {
  if (A.padded == WIDE) return follow<1>(A, path, samples);
  if (A.padded == 2 * WIDE) return follow<2>(A, path, samples);
  if (A.padded == 3 * WIDE) return follow<3>(A, path, samples);
  if (A.padded == 4 * WIDE) return follow<4>(A, path, samples);
  for (Size k = 0; k < samples; ++k, path += A.padded) all_strips<1>(A, path, 0, path + A.padded);
}

// COUNT registers of a row = sum of f_l times the rows l of b, `apart` each from the next, from column j on: the last
// register ends at m
template <int LENGTH, int COUNT>
INLINE void row_strip(const double *f, const int *which, int count, const double *b, int apart, int m, int j,
                      double *row) {
  Vector<LENGTH> sum[COUNT] = {};
  int from[COUNT];
#pragma GCC unroll 4
  for (int s = 0; s < COUNT; ++s) from[s] = std::min(j + s * LENGTH, m - LENGTH);
  for (int l = 0; l < count; ++l) {
    if (!which && f[l] == 0.0) continue;
    const double f_l = f[l];
    const double *b_l = b + static_cast<Size>(which ? which[l] : l) * apart;
#pragma GCC unroll 4
    for (int s = 0; s < COUNT; ++s) sum[s] += read<LENGTH>(b_l + from[s]) * f_l;
  }
#pragma GCC unroll 4
  for (int s = 0; s < COUNT; ++s) write<LENGTH>(row + from[s], sum[s]);
}

template <int LENGTH>
INLINE void row_product(const double *f, const int *which, int count, const double *b, int apart, int m, double *row) {
  for (int j = 0; j < m; j += 4 * LENGTH) {
    if (j + 3 * LENGTH < m) row_strip<LENGTH, 4>(f, which, count, b, apart, m, j, row);
    else if (j + 2 * LENGTH < m) row_strip<LENGTH, 3>(f, which, count, b, apart, m, j, row);
    else if (j + LENGTH < m) row_strip<LENGTH, 2>(f, which, count, b, apart, m, j, row);
    else row_strip<LENGTH, 1>(f, which, count, b, apart, m, j, row);
  }
}

// a row f (k) times b (k, .), the first m columns, at least WIDE of them; zeros in f cost nothing
INLINE void wide_row(const double *f, const double *b, double *row, int k, int apart, int m) {
  if (m <= 4 * WIDE || k > FEW) return row_product<WIDE>(f, nullptr, k, b, apart, m, row);
  int which[FEW], count = 0; // several times through f: what is not zero is found once
  double kept[FEW];
  for (int l = 0; l < k; ++l)
    if (f[l] != 0.0) kept[count] = f[l], which[count++] = l;
  row_product<WIDE>(kept, which, count, b, apart, m, row);
}

// c (n, m) = a (n, k) b (k, m); zeros in a cost nothing
void multiply(const double *a, const double *b, double *c, int n, int k, int m) {
  for (int i = 0; i < n; ++i, a += k, c += m) {
    if (m >= WIDE) wide_row(a, b, c, k, m, m);
    else if (WIDE > 4 && m >= 4) row_product<4>(a, nullptr, k, b, m, m, c);
    else if (WIDE > 2 && m >= 2) row_product<2>(a, nullptr, k, b, m, m, c);
    else row_product<1>(a, nullptr, k, b, m, m, c);
  }
}

// symmetric c (n, n) = a (n, k) b (k, n): what is below the diagonal, and above the same again
void multiply_symmetric(const double *a, const double *b, double *c, int n, int k) {
  if (n < WIDE) multiply(a, b, c, n, k, n);
  else
    for (int i = 0; i < n; ++i) wide_row(a + i * k, b, c + i * n, k, n, std::min(n, (i / WIDE + 1) * WIDE));
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < i; ++j) c[j * n + i] = c[i * n + j];
}

} // namespace strips
} // namespace
