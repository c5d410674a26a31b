// Rotations for Python: the C++ of common/rotation.hpp, for tests against its numpy twin and for loops.
#include "common/python.hpp"
#include "common/rotation.hpp"

#include <stdexcept>

namespace gyrofree {
namespace {

constexpr std::size_t QUATERNION = 4;  // numbers in one

Quaternion quaternion(const VectorIn& q) {
  if (q.shape(0) != QUATERNION) throw std::invalid_argument("q: want 4 numbers, w x y z");
  const auto v = map(q);
  enum { W, QX, QY, QZ };
  return {v(W), v(QX), v(QY), v(QZ)};
}

Vector3 vector(const VectorIn& v) {
  if (v.shape(0) != 3) throw std::invalid_argument("v: want 3 numbers");
  return map(v);
}

Matrix3 matrix(const MatrixIn& C) {
  if (C.shape(0) != 3 || C.shape(1) != 3) throw std::invalid_argument("C: want the shape (3, 3)");
  return map(C);
}

Vector<QUATERNION> numbers(const Quaternion& q) { return {q.w, q.x, q.y, q.z}; }

// q after each of the turns, the first row as given (E-10).
MatrixOut followed(const VectorIn& q_nb, const MatrixIn& turns) {
  if (turns.shape(1) != 3) throw std::invalid_argument("turns: want the shape (n, 3)");
  auto out = new_array<MatrixOut>({turns.shape(0) + 1, QUATERNION});
  Eigen::Map<RowMajor> rows(out.data(), static_cast<Eigen::Index>(turns.shape(0) + 1), QUATERNION);
  Quaternion q = quaternion(q_nb);
  rows.row(0) = numbers(q);
  for (Eigen::Index k = 0; k < rows.rows() - 1; ++k) {
    q = q * from_rotation_vector(map(turns).row(k));
    rows.row(k + 1) = numbers(q);
  }
  return out;
}

void bind_conversions(nb::module_& r) {
  r.def("from_rotation_vector",
        [](const VectorIn& v) { return to_numpy_vector(numbers(from_rotation_vector(vector(v)))); }, nb::arg("v"));
  r.def("to_matrix", [](const VectorIn& q) { return to_numpy(to_matrix(quaternion(q))); }, nb::arg("q_nb"));
  r.def("from_matrix", [](const MatrixIn& C) { return to_numpy_vector(numbers(from_matrix(matrix(C)))); },
        nb::arg("C_nb"));
  r.def("rotation_vector", [](const MatrixIn& C) { return to_numpy_vector(rotation_vector(matrix(C))); },
        nb::arg("C"));
  r.def("euler_matrix",
        [](double roll, double pitch, double yaw) { return to_numpy(euler_matrix({roll, pitch, yaw})); },
        nb::arg("roll"), nb::arg("pitch"), nb::arg("yaw"));
  r.def("euler_angles",
        [](const MatrixIn& C) {
          const EulerAngles a = euler_angles(matrix(C));
          return nb::make_tuple(a.roll, a.pitch, a.yaw);
        },
        nb::arg("C_nb"));
}

}  // namespace

void bind_rotation(nb::module_& m) {
  nb::module_ r = m.def_submodule("rotation", "One rotation at a time; stacks of them: inertial.rotation.");
  bind_conversions(r);
  r.def("multiply",
        [](const VectorIn& p, const VectorIn& q) { return to_numpy_vector(numbers(quaternion(p) * quaternion(q))); },
        nb::arg("p"), nb::arg("q"));
  r.def("turned",
        [](const MatrixIn& C, const VectorIn& v) { return to_numpy(product(matrix(C), turn_matrix(vector(v)))); },
        nb::arg("C_nb"), nb::arg("v_b"), "C_nb after a turn of b by the rotation vector v_b, rad");
  r.def("level",
        [](const VectorIn& f) {
          const auto q = level(vector(f));
          if (!q) throw std::invalid_argument("tilt from gravity: f_b has no direction, or is along x_b");
          return to_numpy_vector(numbers(*q));
        },
        nb::arg("f_b"));
  r.def("roll_pitch",
        [](const VectorIn& f) {
          const EulerAngles a = roll_pitch(vector(f));
          return nb::make_tuple(a.roll, a.pitch);
        },
        nb::arg("f_b"));
  r.def("upright",
        [](const VectorIn& q, const VectorIn& up, double gain) {
          return to_numpy_vector(numbers(upright(quaternion(q), vector(up), gain)));
        },
        nb::arg("q_nb"), nb::arg("up_b"), nb::arg("gain") = 1.0);
  r.def("followed", &followed, nb::arg("q_nb"), nb::arg("turns_b"),
        "q_nb (n + 1, 4) at first and after each of the turns (n, 3), rotation vectors in b, rad");
}

}  // namespace gyrofree
