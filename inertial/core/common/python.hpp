// numpy arrays at the door of the core: shapes and types are checked there, maps go inside.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <initializer_list>
#include <vector>

#include "common/matrix.hpp"

namespace nb = nanobind;

namespace gyrofree {

// Rows of numbers as numpy keeps them; what is not contiguous float64 is copied by nanobind.
using VectorIn = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using MatrixIn = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using VectorOut = nb::ndarray<nb::numpy, double, nb::ndim<1>>;
using MatrixOut = nb::ndarray<nb::numpy, double, nb::ndim<2>>;

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

inline Eigen::Map<const Eigen::VectorXd> map(const VectorIn& a) {
  return {a.data(), static_cast<Eigen::Index>(a.shape(0))};
}

inline Eigen::Map<const RowMajor> map(const MatrixIn& a) {
  return {a.data(), static_cast<Eigen::Index>(a.shape(0)), static_cast<Eigen::Index>(a.shape(1))};
}

// A numpy array that owns the numbers; row by row.
template <typename Array>
Array new_array(std::initializer_list<std::size_t> shape) {
  std::size_t size = 1;
  for (const std::size_t n : shape) size *= n;
  auto* numbers = new double[size == 0 ? 1 : size]();
  nb::capsule owner(numbers, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  return Array(numbers, shape, owner);
}

template <typename Derived>
VectorOut to_numpy_vector(const Eigen::MatrixBase<Derived>& v) {
  auto out = new_array<VectorOut>({static_cast<std::size_t>(v.size())});
  for (Eigen::Index i = 0; i < v.size(); ++i) out.data()[i] = v(i);
  return out;
}

template <typename Derived>
MatrixOut to_numpy(const Eigen::MatrixBase<Derived>& m) {
  auto out = new_array<MatrixOut>({static_cast<std::size_t>(m.rows()), static_cast<std::size_t>(m.cols())});
  Eigen::Map<RowMajor>(out.data(), m.rows(), m.cols()) = m;
  return out;
}

// One for each subject; module.cpp calls them all.
void bind_elementary(nb::module_& m);
void bind_rate(nb::module_& m);
void bind_rotation(nb::module_& m);
void bind_places(nb::module_& m);
void bind_attitude(nb::module_& m);
void bind_alignment(nb::module_& m);
void bind_health(nb::module_& m);
void bind_navigation(nb::module_& m);

}  // namespace gyrofree
