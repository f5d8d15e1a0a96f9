// Numbers in twice the digits, a vector register of them at a time: a sum or a product with what rounding took.
//
// No product is contracted with a sum into an fma: the errors of sums are taken exactly. So is none where these are
// used.
//
// Compiled once for each kind of processor, with registers of REGISTER doubles.

UNCONTRACTED

namespace {
namespace twofold {

constexpr int LANES = REGISTER;
typedef double Lanes __attribute__((vector_size(LANES * 8), may_alias));
typedef std::int64_t Bits __attribute__((vector_size(LANES * 8), may_alias));

INLINE Lanes gathered(const double *const *at, Size i) { // entry i of a frame in each lane
  Lanes out = {};
  for (int l = 0; l < LANES; ++l) out[l] = at[l][i];
  return out;
}

INLINE Lanes all(double v) { return Lanes{} + v; }
INLINE Lanes magnitude(const Lanes &a) { return a < 0.0 ? -a : a; }
INLINE bool any(const Bits &flag) {
  std::int64_t out = 0;
  for (int l = 0; l < LANES; ++l) out |= flag[l];
  return out != 0;
}

INLINE Lanes root(const Lanes &a) {
  Lanes out = {};
  for (int l = 0; l < LANES; ++l) out[l] = std::sqrt(a[l]);
  return out;
}
INLINE Lanes rest(const Lanes &a, const Lanes &b, const Lanes &ab) {
  Lanes out = {};
  for (int l = 0; l < LANES; ++l) out[l] = std::fma(a[l], b[l], -ab[l]);
  return out;
}

struct Twofold { // an unrounded number: high + low
  Lanes high, low;
};

INLINE Twofold product(const Lanes &a, const Lanes &b) {
  const Lanes ab = a * b;
  return {ab, rest(a, b, ab)};
}
INLINE Twofold operator+(const Twofold &a, const Twofold &b) {
  const Lanes s = a.high + b.high, back = s - a.high;
  return {s, (a.high - (s - back)) + (b.high - back) + (a.low + b.low)};
}
INLINE Twofold operator-(const Twofold &a) { return {-a.high, -a.low}; }
INLINE Twofold operator-(const Twofold &a, const Twofold &b) { return a + (-b); }
INLINE Twofold operator*(const Twofold &a, const Lanes &b) {
  const Twofold p = product(a.high, b);
  return {p.high, p.low + a.low * b};
}
INLINE Twofold twice(const Twofold &a) { return {2.0 * a.high, 2.0 * a.low}; }
INLINE Lanes rounded(const Twofold &a) { return a.high + a.low; }

} // namespace twofold
} // namespace

CONTRACTED
