// Kernels for processors with AVX-512.

#include "standard.hpp"

#if DISPATCHES
V4
#define REGISTER 8
#define SIZES(X)
#define BELOW v3_kernels.passes
#include "../kalman/lanes.hpp"
#include "../kalman/strips.hpp"
#include "../kalman/passes.hpp"

const Passes v4_passes = passes::table;
#endif
