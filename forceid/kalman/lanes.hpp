// Many records or models side by side, one in each lane of a vector register of REGISTER doubles: matrices of
// Lanes, sparse alike in all lanes.

namespace {
namespace lanes {

constexpr int LANES = REGISTER;
typedef double Lanes __attribute__((vector_size(LANES * 8), may_alias));
using Fleet = std::vector<Lanes, Aligned<Lanes>>;

INLINE Lanes all(double v) { return Lanes{} + v; }

// Which entries of a matrix may hold something, row by row.
struct Pattern {
  std::vector<int> begin, column, entry;
  template <typename Held> Pattern(int rows, int columns, Held held) : begin(1, 0) {
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j)
        if (held(i, j)) {
          column.push_back(j);
          entry.push_back(i * columns + j);
        }
      begin.push_back(static_cast<int>(column.size()));
    }
  }
};

// y, `apart` each from the next, = a row of a sparse a times x (columns, m)
template <int WIDTH>
INLINE void multiply_strip(const Lanes *a, const int *column, int count, const Lanes *x, int m, Lanes *y, int apart) {
  Lanes sum[WIDTH] = {};
  for (int l = 0; l < count; ++l) {
    const Lanes f = a[l], *row = x + column[l] * m;
    for (int j = 0; j < WIDTH; ++j) sum[j] += f * row[j];
  }
  for (int j = 0; j < WIDTH; ++j) y[j * apart] = sum[j];
}

// the same for the first `width` columns of one row
INLINE void multiply_row(const Lanes *a, const int *column, int count, const Lanes *x, int m, Lanes *y, int width,
                         int apart = 1) {
  int j = 0;
  for (; j + 9 <= width; j += 9) multiply_strip<9>(a, column, count, x + j, m, y + j * apart, apart);
  for (; j + 6 <= width; j += 6) multiply_strip<6>(a, column, count, x + j, m, y + j * apart, apart);
  for (; j + 3 <= width; j += 3) multiply_strip<3>(a, column, count, x + j, m, y + j * apart, apart);
  for (; j < width; ++j) multiply_strip<1>(a, column, count, x + j, m, y + j * apart, apart);
}

// P <- a P a^T of a sparse a and symmetric P, lower half; work (n, n)
INLINE void congruence(const int *begin, const int *column, const Lanes *a, Lanes *P, Lanes *work, int n) {
  for (int i = 0; i < n; ++i) // a P, transposed
    multiply_row(a + begin[i], column + begin[i], begin[i + 1] - begin[i], P, n, work + i, n, n);
  for (int i = 0; i < n; ++i)
    multiply_row(a + begin[i], column + begin[i], begin[i + 1] - begin[i], work, n, P + i * n, i + 1);
}

INLINE void mirror(Lanes *a, int n) {
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < i; ++j) a[j * n + i] = a[i * n + j];
}

} // namespace lanes
} // namespace
