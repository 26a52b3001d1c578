#include "handsim/python/arrays.h"

#include <algorithm>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::python {

namespace {

std::vector<py::ssize_t> shape_of(const py::array& array) {
  return {array.shape(), array.shape() + array.ndim()};
}

}  // namespace

std::string shape_text(const std::vector<py::ssize_t>& shape) {
  std::string out = "shape (";
  for (std::size_t i = 0; i < shape.size(); ++i) out += fmt::format("{}{}", i == 0 ? "" : ", ", shape[i]);
  return out + (shape.size() == 1 ? ",)" : ")");
}

std::string described(const py::array& array) {
  return fmt::format("{}, dtype {}", shape_text(shape_of(array)), py::str(array.dtype()).cast<std::string>());
}

namespace {

/// The object as an array of T in C order. @param kinds of dtype that convert, as numpy has them
template <class T>
auto array_as(const py::object& object, const std::string& name, std::string_view kinds,
              const std::vector<py::ssize_t>& shape, const std::string& need) {
  const py::array array = py::array::ensure(object);
  if (!array) {
    PyErr_Clear();
    throw input_error(name, py::str(py::type::of(object).attr("__name__")).cast<std::string>(), need);
  }
  if (kinds.find(array.dtype().kind()) == std::string_view::npos || shape_of(array) != shape)
    throw input_error(name, described(array), need);
  if constexpr (std::unsigned_integral<T>)
    if (array.dtype().kind() == 'i')
      for (const py::handle each : array.attr("flat"))
        if (each.attr("item")().cast<std::int64_t>() < 0)
          throw input_error(name, py::str(each).cast<std::string>(), need);
  return py::array_t<T, py::array::c_style | py::array::forcecast>::ensure(array);
}

}  // namespace

Numbers::Numbers(const py::object& object, const std::vector<py::ssize_t>& shape, const std::string& name) {
  const auto numbers = array_as<double>(object, name, "fiu", shape,
                                        shape_text(shape) + ", dtype float64, float32 or an integer");
  keep_ = numbers;
  span_ = {numbers.data(), static_cast<std::size_t>(numbers.size())};
}

std::vector<std::uint64_t> seeds_of(const py::object& object, std::size_t size) {
  const auto rows = static_cast<py::ssize_t>(size);
  const std::string need = shape_text({rows}) + ", integers of 0 or more, below 2^64";
  const auto seeds = array_as<std::uint64_t>(object, "seeds", "iu", {rows}, need);
  return {seeds.data(), seeds.data() + size};
}

std::vector<unsigned char> mask_of(const py::object& object, std::size_t size) {
  if (object.is_none()) return {};
  const auto rows = static_cast<py::ssize_t>(size);
  const auto flags = array_as<bool>(object, "mask", "b", {rows}, shape_text({rows}) + ", dtype bool");
  return {flags.data(), flags.data() + size};
}

py::array_t<double> array_of(std::span<const double> numbers, std::size_t columns) {
  std::vector<py::ssize_t> shape = {static_cast<py::ssize_t>(numbers.size())};
  if (columns > 0)
    shape = {static_cast<py::ssize_t>(numbers.size() / columns), static_cast<py::ssize_t>(columns)};
  py::array_t<double> out(shape);
  std::ranges::copy(numbers, out.mutable_data());
  return out;
}

}  // namespace handsim::python
