// Whittle's likelihood of many channels that few processes drive, a band of frequencies in each lane: see
// `misfit` in elastic.py.

namespace {
namespace spectra {

using namespace lanes;

constexpr int AT_ONCE = 4; // variances whose product stays far from the ends of the exponent

// rows D (channel, mode), power (band, channel, channel), density p (band, mode) -> of S = 1 + D p D^T the sum
// log det S + tr S^-1 power (band,), and its slopes (band, mode) by p
Two misfit(Array rows, Array power, Array density) {
  const Size bands = power.shape(0);
  const int c = static_cast<int>(rows.shape(0)), m = static_cast<int>(rows.shape(1));
  const double *D = rows.data();
  Out value({bands}), slope({bands, m});
  Fleet p(m), seen(c * c), L(c * c), root(c * c), U(c * m);
  for (Size first = 0; first < bands; first += LANES) {
    for (int l = 0; l < LANES; ++l) {
      const Size at = std::min(first + l, bands - 1);
      for (int k = 0; k < m; ++k) p[k][l] = density.data()[at * m + k];
      for (int i = 0; i < c * c; ++i) seen[i][l] = power.data()[at * c * c + i];
    }
    for (int i = 0; i < c; ++i) // S, then L with L L^T = S, below the diagonal; on it 1 / L
      for (int j = 0; j <= i; ++j) {
        Lanes sum = all(i == j);
        for (int k = 0; k < m; ++k) sum += p[k] * (D[i * m + k] * D[j * m + k]);
        L[i * c + j] = sum;
      }
    Lanes product = all(1.0), total = {};
    for (int j = 0; j < c; ++j) {
      Lanes d = L[j * c + j];
      for (int l = 0; l < j; ++l) d -= L[j * c + l] * L[j * c + l];
      product *= d;
      if (j % AT_ONCE == AT_ONCE - 1 || j == c - 1) {
        for (int l = 0; l < LANES; ++l) total[l] += std::log(product[l]);
        product = all(1.0);
      }
      for (int l = 0; l < LANES; ++l) d[l] = 1.0 / std::sqrt(d[l]);
      L[j * c + j] = d;
      for (int i = j + 1; i < c; ++i) {
        Lanes s = L[i * c + j];
        for (int l = 0; l < j; ++l) s -= L[i * c + l] * L[j * c + l];
        L[i * c + j] = s * d;
      }
    }
    for (int j = 0; j < c; ++j) // root = L^-1
      for (int i = j; i < c; ++i) {
        Lanes s = all(i == j);
        for (int l = j; l < i; ++l) s -= L[i * c + l] * root[l * c + j];
        root[i * c + j] = s * L[i * c + i];
      }
    for (int i = 0; i < c; ++i) // S^-1 in place of L
      for (int j = 0; j <= i; ++j) {
        Lanes s = {};
        for (int l = i; l < c; ++l) s += root[l * c + i] * root[l * c + j];
        L[i * c + j] = L[j * c + i] = s;
      }
    for (int i = 0; i < c * c; ++i) total += L[i] * seen[i];
    for (int i = 0; i < c; ++i)
      for (int k = 0; k < m; ++k) {
        Lanes s = {};
        for (int j = 0; j < c; ++j) s += L[i * c + j] * D[j * m + k];
        U[i * m + k] = s;
      }
    for (int k = 0; k < m; ++k) {
      Lanes by = {};
      for (int i = 0; i < c; ++i) {
        Lanes s = all(D[i * m + k]);
        for (int j = 0; j < c; ++j) s -= seen[i * c + j] * U[j * m + k];
        by += s * U[i * m + k];
      }
      for (int l = 0; l < LANES && first + l < bands; ++l) slope.data()[(first + l) * m + k] = by[l];
    }
    for (int l = 0; l < LANES && first + l < bands; ++l) value.data()[first + l] = total[l];
  }
  return {value, slope};
}

} // namespace spectra
} // namespace
