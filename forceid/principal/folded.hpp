// Sums over the numbers of every frame by weights that stand still, A W^T: resultants read their data once.
//
// Long frames: four at a time, whose numbers and weights are read in chunks and stretches that stay near. Short ones: a frame in
// each vector lane.
//
// Compiled once for each kind of processor, with registers of REGISTER doubles.

namespace {
namespace folded {

constexpr int LANES = REGISTER, SUMS = 6, HALF = SUMS / 2, FRAMES = 4;
constexpr Size CHUNK = 2048, STRETCH = 256, SHORT = 64; // numbers
typedef double Lanes __attribute__((vector_size(LANES * 8), may_alias));
typedef double Loose __attribute__((vector_size(LANES * 8), may_alias, aligned(8)));

INLINE Lanes near(const double *p) { return *reinterpret_cast<const Loose *>(p); }

INLINE double added(const Lanes &a) {
  double out = 0.0;
  for (int l = 0; l < LANES; ++l) out += a[l];
  return out;
}

INLINE void ahead(const double *a, Size K) { // the next frames, which no processor foresees along four rows at once
  for (int f = 0; f < FRAMES; ++f) __builtin_prefetch(a + (FRAMES + f) * K);
}

// Adds to `out` what `length` numbers of `count` frames make, FRAMES at most; a frame and a row of weights have K.
INLINE void long_frames(const double *A, int count, const double *W, Size K, Size length, double *out) {
  Lanes sum[FRAMES][SUMS] = {};
  const double *a[FRAMES];
  for (int f = 0; f < FRAMES; ++f) a[f] = A + std::min(f, count - 1) * K;
  const Size whole = length / LANES * LANES;
  for (Size begin = 0; begin < whole; begin += STRETCH) {
    const Size end = std::min(begin + STRETCH, whole);
    for (int half = 0; half < SUMS; half += HALF) {
      Lanes s00 = sum[0][half], s01 = sum[0][half + 1], s02 = sum[0][half + 2]; // in registers
      Lanes s10 = sum[1][half], s11 = sum[1][half + 1], s12 = sum[1][half + 2];
      Lanes s20 = sum[2][half], s21 = sum[2][half + 1], s22 = sum[2][half + 2];
      Lanes s30 = sum[3][half], s31 = sum[3][half + 1], s32 = sum[3][half + 2];
      const double *w = W + half * K, *a0 = a[0], *a1 = a[1], *a2 = a[2], *a3 = a[3];
      for (Size k = begin; k < end; k += LANES) {
        const Lanes u = near(w + k), v = near(w + K + k), t = near(w + 2 * K + k);
        if (!half) ahead(a0 + k, K);
        Lanes x = near(a0 + k);
        s00 += x * u, s01 += x * v, s02 += x * t;
        x = near(a1 + k);
        s10 += x * u, s11 += x * v, s12 += x * t;
        x = near(a2 + k);
        s20 += x * u, s21 += x * v, s22 += x * t;
        x = near(a3 + k);
        s30 += x * u, s31 += x * v, s32 += x * t;
      }
      sum[0][half] = s00, sum[0][half + 1] = s01, sum[0][half + 2] = s02;
      sum[1][half] = s10, sum[1][half + 1] = s11, sum[1][half + 2] = s12;
      sum[2][half] = s20, sum[2][half + 1] = s21, sum[2][half + 2] = s22;
      sum[3][half] = s30, sum[3][half + 1] = s31, sum[3][half + 2] = s32;
    }
  }
  for (int f = 0; f < count; ++f)
    for (int s = 0; s < SUMS; ++s) {
      double total = added(sum[f][s]);
      for (Size k = whole; k < length; ++k) total += a[f][k] * W[s * K + k];
      out[f * SUMS + s] += total;
    }
}

// Of `count` frames from A on, LANES of them at most.
INLINE void short_frames(const double *A, Size count, const double *W, Size K, double *out) {
  const double *a[LANES];
  for (int l = 0; l < LANES; ++l) a[l] = A + std::min<Size>(l, count - 1) * K;
  Lanes sum[SUMS] = {};
  for (Size k = 0; k < K * LANES; k += 8) __builtin_prefetch(A + 8 * K * LANES + k);
  for (Size k = 0; k < K; ++k) {
    Lanes x = {};
    for (int l = 0; l < LANES; ++l) x[l] = a[l][k];
    for (int s = 0; s < SUMS; ++s) sum[s] += x * W[s * K + k];
  }
  for (int l = 0; l < LANES && l < count; ++l)
    for (int s = 0; s < SUMS; ++s) out[l * SUMS + s] = sum[s][l];
}

// A (frame, number) W (6, number)^T, written into out (frame, 6).
void sums(Array A_, Array W_, Out out_) {
  const Size frames = A_.shape(0), K = A_.shape(1);
  if (W_.shape(0) != SUMS || W_.shape(1) != K || out_.shape(0) != frames || out_.shape(1) != SUMS)
    throw std::invalid_argument("weights do not fit the frames");
  const double *A = A_.data(), *W = W_.data();
  double *out = out_.data();
  if (K <= SHORT) {
    for (Size f = 0; f < frames; f += LANES) short_frames(A + f * K, frames - f, W, K, out + f * SUMS);
    return;
  }
  std::fill(out, out + frames * SUMS, 0.0);
  for (Size begin = 0; begin < K; begin += CHUNK)
    for (Size f = 0; f < frames; f += FRAMES)
      long_frames(A + f * K + begin, static_cast<int>(std::min<Size>(FRAMES, frames - f)), W + begin, K,
                  std::min(CHUNK, K - begin), out + f * SUMS);
}

} // namespace folded
} // namespace
