// What kernels take from the standard library: known before any of them asks for instructions of its own.

#pragma once

#include "kernels.hpp"
#include "processor.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
