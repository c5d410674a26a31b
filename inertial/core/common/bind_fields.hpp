// Structs that name their fields (common/fields.hpp) as Python classes: attributes of those names,
// keyword construction, exact pickling, comparison to the bit.
#pragma once

#include <string>

#include "common/fields.hpp"
#include "common/python.hpp"

namespace gyrofree {

namespace detail {

inline nb::ndarray<const double, nb::c_contig, nb::device::cpu> numbers_of(nb::handle value) {
  const auto numpy = nb::module_::import_("numpy");
  return nb::cast<nb::ndarray<const double, nb::c_contig, nb::device::cpu>>(
      numpy.attr("ascontiguousarray")(value, "float64"));
}

template <typename M>
void set_matrix(M& target, nb::handle value, const char* name) {
  const auto given = numbers_of(value);
  constexpr bool vector = M::ColsAtCompileTime == 1;
  const auto rows = given.ndim() > 0 ? static_cast<Eigen::Index>(given.shape(0)) : 1;
  const auto columns = given.ndim() > 1 ? static_cast<Eigen::Index>(given.shape(1)) : 1;
  const bool fits = given.ndim() == (vector ? 1 : 2) &&
                    (M::RowsAtCompileTime == Eigen::Dynamic || rows == M::RowsAtCompileTime) &&
                    (M::ColsAtCompileTime == Eigen::Dynamic || columns == M::ColsAtCompileTime) &&
                    (M::MaxRowsAtCompileTime == Eigen::Dynamic || rows <= M::MaxRowsAtCompileTime) &&
                    (M::MaxColsAtCompileTime == Eigen::Dynamic || columns <= M::MaxColsAtCompileTime);
  if (!fits)
    throw nb::value_error((std::string(name) + ": got an array of shape (" + std::to_string(rows) +
                           (given.ndim() > 1 ? ", " + std::to_string(columns) : std::string()) +
                           "), which does not fit the field")
                              .c_str());
  target.resize(rows, columns);
  for (Eigen::Index i = 0; i < rows; ++i)
    for (Eigen::Index j = 0; j < columns; ++j) target(i, j) = given.data()[i * columns + j];
}

template <typename T>
nb::object to_python(T& value, nb::handle owner) {
  if constexpr (std::is_enum_v<T>) {
    return nb::cast(static_cast<int>(value));
  } else if constexpr (std::is_arithmetic_v<T>) {
    return nb::cast(value);
  } else if constexpr (fields::IsMatrix<T>::value) {
    if constexpr (T::ColsAtCompileTime == 1)
      return nb::cast(to_numpy_vector(value));
    else
      return nb::cast(to_numpy(value));
  } else if constexpr (fields::IsArray<T>::value || fields::IsVector<T>::value) {
    nb::list out;
    for (auto& item : value) out.append(to_python(item, owner));
    return out;
  } else {
    return nb::inst_reference(nb::type<T>(), &value, owner);
  }
}

template <typename T>
void from_python(T& target, nb::handle value, const char* name) {
  if constexpr (std::is_enum_v<T>) {
    target = static_cast<T>(nb::cast<int>(value));
  } else if constexpr (std::is_arithmetic_v<T>) {
    target = nb::cast<T>(value);
  } else if constexpr (fields::IsMatrix<T>::value) {
    set_matrix(target, value, name);
  } else if constexpr (fields::IsArray<T>::value || fields::IsVector<T>::value) {
    std::size_t i = 0;
    if (nb::len(value) != target.size()) throw nb::value_error("the number of items cannot change");
    for (const auto item : value) from_python(target[i++], item, name);
  } else {
    target = nb::cast<const T&>(value);
  }
}

// Visitors that look for one field by its name.
struct Getter {
  std::string_view wanted;
  nb::handle owner;
  nb::object found;
  template <typename T>
  void operator()(const char* name, T& value) {
    if (wanted == name) found = to_python(value, owner);
  }
};

struct Setter {
  std::string_view wanted;
  nb::handle given;
  bool found = false;
  template <typename T>
  void operator()(const char* name, T& value) {
    if (wanted != name) return;
    from_python(value, given, name);
    found = true;
  }
};

struct Names {
  nb::list names;
  template <typename T>
  void operator()(const char* name, T&) {
    names.append(name);
  }
};

// What Python does with a struct, its type left behind: compiled once for all structs.
struct Access {
  const char* name;
  void (*construct)(void* self);
  nb::object (*get)(void* self, const char* field, nb::handle owner);
  bool (*set)(void* self, const char* field, nb::handle value);
  nb::list (*names)(void* self);
  std::string (*save)(const void* self);
  void (*restore)(void* self, std::string_view bits);  // self is not constructed yet
};

template <typename T>
const Access* access_of(const char* name) {
  static Access access;
  access = {name,
            [](void* self) { new (self) T(); },
            [](void* self, const char* field, nb::handle owner) {
              Getter getter{field, owner, {}};
              T::visit(*static_cast<T*>(self), getter);
              return getter.found;
            },
            [](void* self, const char* field, nb::handle value) {
              Setter setter{field, value};
              T::visit(*static_cast<T*>(self), setter);
              return setter.found;
            },
            [](void* self) {
              Names names;
              T::visit(*static_cast<T*>(self), names);
              return names.names;
            },
            [](const void* self) { return saved(*static_cast<const T*>(self)); },
            [](void* self, std::string_view bits) { new (self) T(restored<T>(bits)); }};
  return &access;
}

void define_fields(nb::handle cls, const Access* access);

}  // namespace detail

// A class of a submodule that is an attribute of inertial.core: pickle finds it there whichever build
// of the core is loaded.
template <typename T>
nb::class_<T> bind_fields(nb::module_& m, const char* name, const char* what) {
  auto c = nb::class_<T>(m, name, what);
  detail::define_fields(c, detail::access_of<T>(name));
  c.attr("__module__") = "inertial.core";
  c.attr("__qualname__") = nb::str((nb::cast<std::string>(m.attr("__name__")) + "." + name).c_str());
  return c;
}

// Columns of a table of T for numpy: name, format or nested columns, shape, offset.
class Columns {
 public:
  explicit Columns(const void* origin) : origin_(static_cast<const char*>(origin)) {}

  template <typename T>
  void operator()(const char* name, T& value) {
    const auto offset = reinterpret_cast<const char*>(&value) - origin_;
    if constexpr (std::is_enum_v<T> || std::is_integral_v<T>) {
      static_assert(sizeof(T) == 4 || sizeof(T) == 1);
      columns.append(nb::make_tuple(name, sizeof(T) == 4 ? "i4" : "?", nb::make_tuple(), offset));
    } else if constexpr (std::is_floating_point_v<T>) {
      columns.append(nb::make_tuple(name, "f8", nb::make_tuple(), offset));
    } else if constexpr (fields::IsMatrix<T>::value) {
      static_assert(T::ColsAtCompileTime == 1 || T::IsRowMajor, "numpy reads row by row");
      columns.append(nb::make_tuple(name, "f8",
                                    T::ColsAtCompileTime == 1 ? nb::make_tuple(value.rows())
                                                              : nb::make_tuple(value.rows(), value.cols()),
                                    offset));
    } else {
      Columns inner(&value);
      T::visit(value, inner);
      columns.append(nb::make_tuple(name, nb::make_tuple(inner.columns, sizeof(T)), nb::make_tuple(), offset));
    }
  }

  nb::list columns;

 private:
  const char* origin_;
};

template <typename T>
nb::tuple columns_of() {
  T value;
  Columns columns(&value);
  T::visit(value, columns);
  return nb::make_tuple(columns.columns, sizeof(T));
}

// The rows of a table, as bytes that numpy views with the dtype made of columns_of.
template <typename T>
nb::ndarray<nb::numpy, std::uint8_t, nb::ndim<1>> table(std::vector<T> rows) {
  auto* kept = new std::vector<T>(std::move(rows));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return {reinterpret_cast<std::uint8_t*>(kept->data()), {kept->size() * sizeof(T)}, owner};
}

}  // namespace gyrofree
