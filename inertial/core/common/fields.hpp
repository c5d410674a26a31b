// A struct says its fields once, by name:
//
//   template <class Self, class Visitor>
//   static void visit(Self& s, Visitor& v) { v("time", s.time); v("v_n", s.v_n); }
//
// From that its exact bits are kept and given back (pickling), and rows of results become a numpy
// table with named columns.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "common/matrix.hpp"

namespace gyrofree {

namespace fields {
template <typename T>
struct IsMatrix : std::is_base_of<Eigen::PlainObjectBase<T>, T> {};
template <typename T>
struct IsArray : std::false_type {};
template <typename T, std::size_t N>
struct IsArray<std::array<T, N>> : std::true_type {};
template <typename T>
struct IsVector : std::false_type {};
template <typename T>
struct IsVector<std::vector<T>> : std::true_type {};
}  // namespace fields

// Appends the exact bits of a struct's fields.
class Writer {
 public:
  template <typename T>
  void operator()(const char*, const T& value) {
    put(value);
  }

  template <typename T>
  void put(const T& value) {
    if constexpr (std::is_arithmetic_v<T> || std::is_enum_v<T>) {
      bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    } else if constexpr (fields::IsMatrix<T>::value) {
      put(static_cast<std::int64_t>(value.rows()));
      put(static_cast<std::int64_t>(value.cols()));
      bytes_.append(reinterpret_cast<const char*>(value.data()), sizeof(double) * value.size());
    } else if constexpr (fields::IsArray<T>::value || fields::IsVector<T>::value) {
      put(static_cast<std::int64_t>(value.size()));
      for (const auto& item : value) put(item);
    } else {
      T::visit(value, *this);
    }
  }

  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// Takes them again. Throws std::invalid_argument for bytes that another build of the struct wrote.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}

  template <typename T>
  void operator()(const char* name, T& value) {
    name_ = name;
    take(value);
  }

  template <typename T>
  void take(T& value) {
    if constexpr (std::is_arithmetic_v<T> || std::is_enum_v<T>) {
      copy(&value, sizeof value);
    } else if constexpr (fields::IsMatrix<T>::value) {
      take_matrix(value);
    } else if constexpr (fields::IsVector<T>::value) {
      value.resize(static_cast<std::size_t>(count(static_cast<std::int64_t>(bytes_.size()))));
      for (auto& item : value) take(item);
    } else if constexpr (fields::IsArray<T>::value) {
      if (count(static_cast<std::int64_t>(value.size())) != static_cast<std::int64_t>(value.size())) refuse();
      for (auto& item : value) take(item);
    } else {
      T::visit(value, *this);
    }
  }

  void finish() const {
    if (at_ != bytes_.size()) refuse();
  }

 private:
  template <typename M>
  void take_matrix(M& value) {
    const auto rows = count(M::MaxRowsAtCompileTime), columns = count(M::MaxColsAtCompileTime);
    if ((M::RowsAtCompileTime != Eigen::Dynamic && rows != M::RowsAtCompileTime) ||
        (M::ColsAtCompileTime != Eigen::Dynamic && columns != M::ColsAtCompileTime))
      refuse();
    value.resize(rows, columns);
    copy(value.data(), sizeof(double) * static_cast<std::size_t>(value.size()));
  }

  std::int64_t count(std::int64_t most) {
    std::int64_t n = 0;
    copy(&n, sizeof n);
    if (n < 0 || (most >= 0 && n > most)) refuse();
    return n;
  }

  void copy(void* target, std::size_t size) {
    if (size > bytes_.size() - at_) refuse();
    std::memcpy(target, bytes_.data() + at_, size);
    at_ += size;
  }

  [[noreturn]] void refuse() const {
    throw std::invalid_argument("saved state does not fit this build of the core, at field " +
                                std::string(name_) + ": start without it");
  }

  std::string_view bytes_;
  std::size_t at_ = 0;
  const char* name_ = "(the first)";
};

template <typename T>
std::string saved(const T& value) {
  Writer writer;
  writer.put(value);
  return writer.bytes();
}

template <typename T>
T restored(std::string_view bytes) {
  T value;
  Reader reader(bytes);
  reader.take(value);
  reader.finish();
  return value;
}

}  // namespace gyrofree
