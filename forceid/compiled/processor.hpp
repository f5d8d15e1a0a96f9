// Which instructions the compiled engines use: chosen when they are loaded, not when they are compiled.
//
// FORCEID_ENGINE_ARCH=baseline, v3 or v4 asks for one: what every processor of its kind runs, AVX2 with FMA,
// AVX-512. Without it the best that this processor runs. One wheel serves all.

#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>
#include <stdexcept>
#include <string>

#define INLINE inline __attribute__((always_inline))

// Between these no product is contracted with a sum into an fma.
#if defined(__clang__)
#define UNCONTRACTED _Pragma("STDC FP_CONTRACT OFF")
#define CONTRACTED
#elif defined(__GNUC__)
#define UNCONTRACTED _Pragma("GCC push_options") _Pragma("GCC optimize(\"fp-contract=off\")")
#define CONTRACTED _Pragma("GCC pop_options")
#else
#define UNCONTRACTED
#define CONTRACTED
#endif

// clang knows no pragma for it; arm64 has its vectors in the baseline
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define DISPATCHES 1
#define V3 _Pragma("GCC target(\"avx2,fma,bmi,bmi2\")")
#define V4 _Pragma("GCC target(\"avx512f,avx512dq,avx512vl,avx512bw,avx2,fma,bmi,bmi2,prefer-vector-width=512\")")
#else
#define DISPATCHES 0
#endif

inline std::string processor() {
#if DISPATCHES
  const bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const bool v4 = v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                  __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw");
#else
  const bool v3 = false, v4 = false;
#endif
  const char *asked = std::getenv("FORCEID_ENGINE_ARCH");
  const std::string name = asked ? asked : "";
  if (name.empty()) return v4 ? "v4" : v3 ? "v3" : "baseline";
  if (name == "baseline" || (name == "v3" && v3) || (name == "v4" && v4)) return name;
  throw std::invalid_argument("FORCEID_ENGINE_ARCH is " + name + ", expected baseline" + (v3 ? ", v3" : "") +
                              (v4 ? ", v4" : "") + " on this processor");
}

// Memory for vector registers of any width.
template <typename T> struct Aligned {
  using value_type = T;
  Aligned() = default;
  template <typename U> Aligned(const Aligned<U> &) {}
  T *allocate(std::size_t n) { return static_cast<T *>(::operator new(n * sizeof(T), std::align_val_t(64))); }
  void deallocate(T *p, std::size_t) { ::operator delete(p, std::align_val_t(64)); }
  friend bool operator==(const Aligned &, const Aligned &) { return true; }
  friend bool operator!=(const Aligned &, const Aligned &) { return false; }
};
