// One list of what a file says of a struct: `T::fields(visit)`, which calls visit(key, member, range,
// more...) for each key.
//   key     as files have it
//   member  `&T::member`, whose initialiser is the default, or in_part(&T::part, &Part::member) of an
//   optional part range   Quantity of numbers and vectors, WholeRange of whole numbers, Words of a choice;
//   none of a flag or a block more    what else is known of the key: the effect or the methods that use it,
//   how two surfaces combine
// From the list come reading (MapReader::fields), keys, checks of ranges, resolved text and what acts on
// nothing.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace handsim {

/// In a field's form: a file must say the number.
struct Required {};
/// In a field's form: a number that a file does not say stays unsaid in the resolved text.
struct Unsaid {};

/// What a whole number must be.
struct WholeRange {
  int min = 0;
  int max = 0;
};

/// The words of an enum, in its order.
struct Words {
  std::span<const std::string_view> names;
};

/// A member of an optional part, which exists if a file states one of its keys.
template <class T, class Part, class Value>
struct InPart {
  std::optional<Part> T::*part;
  Value Part::*value;
};
template <class T, class Part, class Value>
constexpr InPart<T, Part, Value> in_part(std::optional<Part> T::*part, Value Part::*value) {
  return {part, value};
}

/// The value of a field; of an optional part a value, or nothing without the part.
template <class T, class Value>
const Value& field_value(const T& of, Value T::*member) {
  return of.*member;
}
template <class T, class Part, class Value>
std::optional<Value> field_value(const T& of, const InPart<T, Part, Value>& member) {
  return of.*member.part ? std::optional((*(of.*member.part)).*member.value) : std::nullopt;
}

/// Sets a field; nothing leaves an optional part as it is.
template <class T, class Value>
void set_field(T& of, Value T::*member, const Value& value) {
  of.*member = value;
}
template <class T, class Part, class Value>
void set_field(T& of, const InPart<T, Part, Value>& member, const std::optional<Value>& value) {
  if (!value) return;
  if (!(of.*member.part)) (of.*member.part).emplace();
  (*(of.*member.part)).*member.value = *value;
}

template <class T>
std::vector<std::string_view> field_keys() {
  std::vector<std::string_view> out;
  T::fields([&](std::string_view key, const auto&...) { out.push_back(key); });
  return out;
}

template <class T>
bool has_field(std::string_view key) {
  bool found = false;
  T::fields([&](std::string_view each, const auto&...) { found = found || each == key; });
  return found;
}

}  // namespace handsim
