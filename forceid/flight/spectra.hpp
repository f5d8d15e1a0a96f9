// Whittle's likelihood of many channels that few processes drive, a band of frequencies in each lane: see
// `misfit` in elastic.py.

namespace {
namespace spectra {

using namespace lanes;

constexpr int AT_ONCE = 4; // variances whose product stays far from the ends of the exponent

// rows D (channel, mode), power (band, channel, channel), density p (band, mode) -> of S = 1 + D p D^T the sum
// log det S + tr S^-1 power over bands, each counted count (band,) times; its slope (way, mode) where p of a mode moves
// by moves (band, way, mode), and what its second slopes are in the mean (way, mode, way, mode)
Three misfit(Array rows, Array power, Array density, Array count, Array moves) {
  const Size bands = power.shape(0);
  const int c = static_cast<int>(rows.shape(0)), m = static_cast<int>(rows.shape(1));
  const int ways = static_cast<int>(moves.shape(1)), wide = ways * m;
  const double *D = rows.data();
  Out value({1}), slope({ways, m}), bend({ways, m, ways, m});
  std::fill(slope.data(), slope.data() + wide, 0.0);
  std::fill(bend.data(), bend.data() + wide * wide, 0.0);
  value.data()[0] = 0.0;
  Fleet p(m), seen(c * c), L(c * c), root(c * c), U(c * m), t(wide), by_p(m), square(m * m), slopes(wide), bends(wide * wide);
  for (Size first = 0; first < bands; first += LANES) {
    Lanes counted = {};
    for (int l = 0; l < LANES; ++l) {
      const Size at = std::min(first + l, bands - 1);
      if (first + l < bands) counted[l] = count.data()[at];
      for (int i = 0; i < wide; ++i) t[i][l] = moves.data()[at * wide + i];
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
      by_p[k] = by * counted;
      for (int l = 0; l <= k; ++l) {
        Lanes s = {};
        for (int i = 0; i < c; ++i) s += D[i * m + k] * U[i * m + l];
        square[k * m + l] = square[l * m + k] = s * s * counted;
      }
    }
    for (int i = 0; i < wide; ++i) {
      slopes[i] += t[i] * by_p[i % m];
      for (int j = 0; j <= i; ++j) bends[i * wide + j] += t[i] * t[j] * square[i % m * m + j % m];
    }
    total *= counted;
    for (int l = 0; l < LANES; ++l) value.data()[0] += total[l];
  }
  for (int i = 0; i < wide; ++i)
    for (int l = 0; l < LANES; ++l) {
      slope.data()[i] += slopes[i][l];
      for (int j = 0; j <= i; ++j) bend.data()[i * wide + j] += bends[i * wide + j][l];
    }
  for (int i = 0; i < wide; ++i)
    for (int j = 0; j < i; ++j) bend.data()[j * wide + i] = bend.data()[i * wide + j];
  return {value, slope, bend};
}

// `Spectrum.slopes` of whittle.py: x (candidate, axis, 3), order (candidate,), unit (order,): densities of order
// at points of zeros. A group of ordinates in each lane.
Three slopes(double gain, Array w, Array count, Array noise, Array power, Array total, Array x, Index order,
             Array unit) {
  const Size candidates = x.shape(0), axes = x.shape(1), images = w.shape(0), groups = w.shape(1);
  const Size wide = (groups + LANES - 1) / LANES;
  const auto lanes = [&](const double *from, double rest) {
    Fleet out(wide, all(rest));
    for (Size i = 0; i < groups; ++i) out[i / LANES][i % LANES] = from[i];
    return out;
  };
  Out value({candidates, axes}), slope({candidates, axes, 3}), bend({candidates, axes, 3, 3});
  std::vector<Fleet> square(images);
  for (Size k = 0; k < images; ++k) {
    square[k] = lanes(w.data() + k * groups, 1.0);
    for (Lanes &each : square[k]) each *= each;
  }
  const Fleet counted = lanes(count.data(), 0.0);
  for (Size a = 0; a < axes; ++a) {
    const Fleet own = lanes(noise.data() + a * groups, 1.0), seen = lanes(power.data() + a * groups, 0.0),
                reference = lanes(total.data() + a * groups, 1.0);
    for (Size c = 0; c < candidates; ++c) {
      const double *at = x.data() + (c * axes + a) * 3, corner = std::exp(2 * at[1]), loud = std::exp(2 * at[2]);
      const Size n = order.data()[c];
      const double level = gain * gain * unit.data()[n] * std::exp(2 * at[0]);
      Lanes sum = {}, S[3] = {}, B[6] = {}, logs = {};
      for (Size g = 0; g < wide; ++g) {
        Lanes load = {}, along = {};
        for (Size k = 0; k < images; ++k) {
          const Lanes W = square[k][g], shoulder = 1.0 / (corner + W);
          Lanes image = level / (W * W);
          for (Size i = 0; i < n; ++i) image *= shoulder;
          load += image;
          along -= (2.0 * n * corner) * shoulder * image;
        }
        const Lanes noisy = loud * own[g], all_of_it = load + noisy, ratio = all_of_it / reference[g];
        const Lanes shown = seen[g] / ratio, off = shown - counted[g];
        const Lanes D[3] = {2.0 * load / all_of_it, along / all_of_it, 2.0 * noisy / all_of_it};
        for (int l = 0; l < LANES; ++l) logs[l] = std::log(ratio[l]);
        sum -= logs * counted[g] + shown;
        for (int i = 0, at = 0; i < 3; ++i) {
          S[i] += D[i] * off;
          for (int j = 0; j <= i; ++j) B[at++] += D[i] * D[j] * counted[g];
        }
      }
      const auto added = [](const Lanes &v) {
        double out = 0.0;
        for (int l = 0; l < LANES; ++l) out += v[l];
        return out;
      };
      value.data()[c * axes + a] = added(sum);
      double *s = slope.data() + (c * axes + a) * 3, *b = bend.data() + (c * axes + a) * 9;
      for (int i = 0, at = 0; i < 3; ++i) {
        s[i] = added(S[i]);
        for (int j = 0; j <= i; ++j) b[3 * i + j] = b[3 * j + i] = added(B[at++]);
      }
    }
  }
  return {value, slope, bend};
}

// `scoring_step` of whittle.py, and `free_step`; ridge: part of a curvature that is added to it.
Out scoring_step(Array slope, Array bend, Array down, Array up, Array share, double ridge) {
  const Size candidates = slope.shape(0), axes = slope.shape(1), n = axes * 3;
  Out step_({candidates, axes, 3});
  Buffer held(n), top(axes), under(axes), tied(2 * axes), g(n), H(6 * axes);
  std::vector<char> stays(n);
  for (Size c = 0; c < candidates; ++c) {
    const double *s = slope.data() + c * n, *B = bend.data() + 3 * c * n, *low = down.data() + c * n,
                 *high = up.data() + c * n;
    double *step = step_.data() + c * n;
    for (Size a = 0; a < axes; ++a)
      for (int i = 0; i < 3; ++i) {
        double along = s[3 * a + i];
        if (i == 2) {
          along = 0.0;
          for (Size b = 0; b < axes; ++b) along += s[3 * b + 2] * share.data()[b * axes + a];
        }
        stays[3 * a + i] = (low[3 * a + i] >= 0 && along <= 0) || (high[3 * a + i] <= 0 && along >= 0);
        held[3 * a + i] = 0.0;
      }
    for (int turn = 0; turn < 3; ++turn) {
      for (Size a = 0; a < axes; ++a) {
        const double *b = B + 9 * a, *at = &held[3 * a];
        const char *out = &stays[3 * a];
        double *own = &g[3 * a], *h = &H[6 * a]; // aa, bb, cc, ab, ac, bc
        for (int i = 0; i < 3; ++i) {
          own[i] = out[i] ? 0.0 : s[3 * a + i] - (b[3 * i] * at[0] + b[3 * i + 1] * at[1] + b[3 * i + 2] * at[2]);
          h[i] = (out[i] ? 0.0 : b[4 * i]) * (1 + ridge) + ridge;
        }
        h[3] = out[0] || out[1] ? 0.0 : b[1];
        h[4] = out[0] || out[2] ? 0.0 : b[2];
        h[5] = out[1] || out[2] ? 0.0 : b[5];
        const double det = h[0] * h[1] - h[3] * h[3];
        tied[2 * a] = (h[1] * h[4] - h[3] * h[5]) / det;
        tied[2 * a + 1] = (h[0] * h[5] - h[3] * h[4]) / det;
        top[a] = own[2] - tied[2 * a] * own[0] - tied[2 * a + 1] * own[1];
        under[a] = h[2] - tied[2 * a] * h[4] - tied[2 * a + 1] * h[5];
      }
      bool left = false;
      for (Size a = 0; a < axes; ++a) {
        const double *own = &g[3 * a], *h = &H[6 * a], det = h[0] * h[1] - h[3] * h[3];
        double over = 0.0, below = 0.0;
        for (Size b = 0; b < axes; ++b) {
          over += top[b] * share.data()[b * axes + a];
          below += under[b] * share.data()[b * axes + a];
        }
        const double level = over / below, ga = own[0] - h[4] * level, gb = own[1] - h[5] * level;
        const double free[3] = {(h[1] * ga - h[3] * gb) / det, (h[0] * gb - h[3] * ga) / det,
                                stays[3 * a + 2] ? 0.0 : level};
        for (int i = 0; i < 3; ++i) step[3 * a + i] = held[3 * a + i] + free[i];
      }
      for (Size i = 0; i < n; ++i) {
        if (!(step[i] < low[i] || step[i] > high[i])) continue;
        left = true;
        held[i] = std::min(std::max(step[i], low[i]), high[i]);
        stays[i] = 1;
      }
      if (!left) break;
    }
    for (Size i = 0; i < n; ++i) step[i] = std::min(std::max(step[i], low[i]), high[i]);
  }
  return step_;
}

} // namespace spectra
} // namespace
