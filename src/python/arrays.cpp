#include "handsim/python/arrays.h"

#include <algorithm>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::python {

namespace {

std::vector<py::ssize_t> shape_of(const py::array& array) {
  return {array.shape(), array.shape() + array.ndim()};
}

/// Signed and unsigned integers and floats of any size.
bool is_real(const py::array& array) {
  const char kind = array.dtype().kind();
  return kind == 'f' || kind == 'i' || kind == 'u';
}

/// The object as an array, whatever its dtype. @throws Error (input) for what is none.
py::array any_array(const py::object& object, const std::string& name, const std::string& need) {
  py::array array = py::array::ensure(object);
  if (!array) {
    PyErr_Clear();
    throw input_error(name, py::str(py::type::of(object).attr("__name__")).cast<std::string>(), need);
  }
  return array;
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

Numbers::Numbers(const py::object& object, const std::vector<py::ssize_t>& shape, const std::string& name) {
  const std::string need = shape_text(shape) + ", dtype float64, float32 or an integer";
  const py::array array = any_array(object, name, need);
  if (!is_real(array) || shape_of(array) != shape) throw input_error(name, described(array), need);
  const auto numbers = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(array);
  keep_ = numbers;
  span_ = {numbers.data(), static_cast<std::size_t>(numbers.size())};
}

std::vector<std::uint64_t> seeds_of(const py::object& object, std::size_t size) {
  const auto rows = static_cast<py::ssize_t>(size);
  const std::string need = shape_text({rows}) + ", integers of 0 or more, below 2^64";
  const py::array array = any_array(object, "seeds", need);
  const char kind = array.dtype().kind();
  if ((kind != 'u' && kind != 'i') || shape_of(array) != std::vector{rows})
    throw input_error("seeds", described(array), need);
  const auto seeds = py::array_t<std::uint64_t, py::array::c_style | py::array::forcecast>::ensure(array);
  for (py::ssize_t i = 0; i < rows && kind == 'i'; ++i)
    if (static_cast<std::int64_t>(seeds.at(i)) < 0)
      throw input_error("seeds", fmt::format("{}", static_cast<std::int64_t>(seeds.at(i))), need);
  return {seeds.data(), seeds.data() + seeds.size()};
}

std::vector<unsigned char> mask_of(const py::object& object, std::size_t size) {
  if (object.is_none()) return {};
  const auto rows = static_cast<py::ssize_t>(size);
  const std::string need = shape_text({rows}) + ", dtype bool";
  const py::array array = any_array(object, "mask", need);
  if (array.dtype().kind() != 'b' || shape_of(array) != std::vector{rows})
    throw input_error("mask", described(array), need);
  const auto flags = py::array_t<bool, py::array::c_style | py::array::forcecast>::ensure(array);
  return {flags.data(), flags.data() + flags.size()};
}

py::array_t<double> array_of(std::span<const double> numbers, std::size_t columns) {
  std::vector<py::ssize_t> shape = {static_cast<py::ssize_t>(numbers.size())};
  if (columns > 0)
    shape = {static_cast<py::ssize_t>(numbers.size() / columns), static_cast<py::ssize_t>(columns)};
  py::array_t<double> out(shape);
  std::copy(numbers.begin(), numbers.end(), out.mutable_data());
  return out;
}

}  // namespace handsim::python
