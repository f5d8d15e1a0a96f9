// A flight's steps and its smoother, compiled for every kind of processor that gains by it.

#include "../processor.hpp"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

namespace py = pybind11;

namespace {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Index = py::array_t<py::ssize_t, py::array::c_style | py::array::forcecast>;
using Size = py::ssize_t;

} // namespace

#define ARCH baseline
#define REGISTER 2
#include "flight.hpp"
#undef ARCH
#undef REGISTER

#if DISPATCHES
#pragma GCC push_options
V3 // AVX-512 gains nothing more
#define ARCH v3
#define REGISTER 4
#include "flight.hpp"
#undef ARCH
#undef REGISTER
#pragma GCC pop_options
#else
namespace v3 = baseline;
#endif

PYBIND11_MODULE(_flight, module) {
  module.doc() = "The steps of a flight and its smoother, compiled";
  const bool wide = processor() != "baseline";
  module.attr("lanes") = wide ? v3::LANES : baseline::LANES;
  module.def("turn", wide ? v3::turn : baseline::turn);
  module.def("rotation_rows", wide ? v3::rotation_rows : baseline::rotation_rows);
  module.def("smooth", wide ? v3::smooth : baseline::smooth);
  module.def("between", wide ? v3::between : baseline::between);
  module.def("turned", wide ? v3::turned : baseline::turned);
}
