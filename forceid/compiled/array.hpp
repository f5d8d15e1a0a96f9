// Arrays as kernels see them: row-major numbers of a shape, kept by numpy or by themselves. No kernel knows Python.

#pragma once

#include <cstddef>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

using Size = std::ptrdiff_t;
using Buffer = std::vector<double>;

template <typename T> class Tensor {
public:
  Tensor() = default;
  Tensor(T *data, std::vector<Size> shape) : first(data), sizes(std::move(shape)) {} // kept by somebody else
  explicit Tensor(std::vector<Size> shape) : sizes(std::move(shape)) {               // to be filled
    const std::shared_ptr<T[]> memory(new T[size()]);
    first = memory.get();
    kept = memory;
  }
  Tensor(std::vector<std::remove_const_t<T>> values, std::vector<Size> shape) : sizes(std::move(shape)) {
    const auto whole = std::make_shared<std::vector<std::remove_const_t<T>>>(std::move(values));
    first = whole->data();
    kept = whole;
  }
  T *data() const { return first; }
  int ndim() const { return static_cast<int>(sizes.size()); }
  Size shape(int axis) const {
    if (axis >= ndim()) throw std::invalid_argument("an array has too few dimensions");
    return sizes[axis];
  }
  const std::vector<Size> &shape() const { return sizes; }
  Size size() const {
    Size product = 1;
    for (const Size n : sizes) product *= n;
    return product;
  }

private:
  T *first = nullptr;
  std::vector<Size> sizes;
  std::shared_ptr<void> kept;
};

using Array = Tensor<const double>; // read
using Out = Tensor<double>;         // written: returned, or the caller's own
using Index = Tensor<const Size>;
using Mask = Tensor<const unsigned char>;
