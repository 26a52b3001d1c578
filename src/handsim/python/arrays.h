// Arrays of numbers between numpy and the library. A wrong shape or dtype is an Error that says both.
//
// The module serves numpy 1 and 2 with any pybind11 from 2.10 on, Debian's. One before 2.12 takes the size of
// a dtype's items from the place where numpy 1 has it. So arrays are made as `py::array_t<T>` of a shape,
// whose size is T's, and neither of a number alone nor as `py::array` of a dtype; nothing here asks for
// `itemsize` or `nbytes` of a dtype or of a `py::array`.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <pybind11/numpy.h>

#include "handsim/core/pose.h"

namespace handsim::python {

namespace py = pybind11;

/// An array of float64 in C order; one of another real dtype or order is copied.
class Numbers {
 public:
  Numbers() = default;
  /// @param shape that is needed. @param name for messages. @throws Error (input) for another shape or dtype
  Numbers(const py::object& array, const std::vector<py::ssize_t>& shape, const std::string& name);

  std::span<const double> span() const { return span_; }
  bool empty() const { return span_.empty(); }
  /// Numbers of an array, as the constructor makes them; None gives none.
  static Numbers optional(const py::object& array, const std::vector<py::ssize_t>& shape,
                          const std::string& name) {
    return array.is_none() ? Numbers() : Numbers(array, shape, name);
  }

 private:
  py::object keep_;
  std::span<const double> span_;
};

/// A number of 64 bits for each environment, of an integer dtype, 0 or more.
std::vector<std::uint64_t> seeds_of(const py::object& seeds, std::size_t size);
/// One flag for each environment, of dtype bool. None: empty.
std::vector<unsigned char> mask_of(const py::object& mask, std::size_t size);

/// Adds the numbers of a vector, of a quaternion w x y z, and of a pose: both.
inline void append(std::vector<double>& out, const Vec3& v) { out.insert(out.end(), v.begin(), v.end()); }
inline void append(std::vector<double>& out, const Quat& q) {
  out.insert(out.end(), {q.w(), q.x(), q.y(), q.z()});
}
inline void append(std::vector<double>& out, const Pose& x) { append(out, x.p), append(out, x.q); }

/// Memory of an object as an array that keeps the object alive and cannot be written.
template <class T>
py::array_t<T> view_of(const py::object& owner, const std::vector<py::ssize_t>& shape, const T* data) {
  py::array_t<T> out(shape, data, owner);
  out.attr("flags").attr("writeable") = false;
  return out;
}

/// A copy of numbers [rows, columns]; columns 0: one axis.
py::array_t<double> array_of(std::span<const double> numbers, std::size_t columns = 0);

/// `shape (1024, 23), dtype float64`
std::string described(const py::array& array);
std::string shape_text(const std::vector<py::ssize_t>& shape);

}  // namespace handsim::python
