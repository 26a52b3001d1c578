// Records which keys readers ask for while json_schema() runs them. Private to this folder.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "handsim/core/yaml_reader.h"

namespace handsim {

using Json = nlohmann::ordered_json;

/// Removes the first key from a dotted path and returns it.
std::string_view first_key(std::string_view& path);

/// The values that a reader accepts for a key.
struct KeyForm {
  std::vector<Json> types;        ///< accepted ones; empty: the reader only checks that the key exists
  std::vector<YamlNode> samples;  ///< values for further runs of the reader, the usual one first
  bool required = false;
};

KeyForm presence_form();
KeyForm number_form(const Quantity& quantity, std::optional<double> fallback, bool required);
KeyForm integer_form(int min, int max, int fallback);
KeyForm text_form(const std::optional<std::string>& fallback, bool required);
KeyForm name_form();
KeyForm flag_form(bool fallback);
KeyForm vector_form(const Quantity& quantity, const std::optional<Vec3>& fallback);
KeyForm range_form(const Quantity& quantity, bool required);
KeyForm choice_form(const std::vector<std::string_view>& words, std::optional<std::string_view> fallback);
KeyForm texts_form(std::size_t least, std::size_t most, const std::string& need);
KeyForm list_form(std::size_t least, std::size_t most);
KeyForm map_form(bool required);
KeyForm value_form(const ValueForm& form);
/// A file, or a block in its place; the schema of its kind lists its keys.
KeyForm file_form(std::string_view kind, bool required);

/// Name of a kind of file within a schema: `hand_model` of `a hand model`.
std::string definition_name(std::string_view kind);

/// Collects the keys of all runs of a reader.
class SchemaRecorder {
 public:
  /// A value for a key; with it the reader may ask for further keys.
  struct Setting {
    std::string path;
    YamlNode value;
    bool usual = true;
  };

  /// Records that the reader reads a map at this path.
  void record_map(const std::string& path) { visited_.insert(path); }
  /// Records that a key of the map at this path is a file or a block of this kind.
  void record_file(const std::string& path, std::string_view key, std::string_view kind, bool required);
  /// Records that the reader asks for a key of the map at this path.
  void record(const std::string& path, std::string_view key, KeyForm form);
  /// From here on in this run, no key of the map at this path, or within it, is required.
  void make_optional(const std::string& path) { optional_ = path; }
  /// Records that the map at this path allows no other keys.
  void close(const std::string& path) { at(path).closed = true; }

  const std::set<std::string>& kinds() const { return kinds_; }

  /// Ends a run and returns the settings that no run before has returned.
  std::vector<Setting> end_run();
  Json schema() const { return build(root_); }

 private:
  struct Node {
    std::string key;  ///< `0`: items of a list, `*`: keys of any name
    std::vector<Json> types = {};
    std::vector<Node> children = {};
    std::optional<std::set<std::string>> required = {};  ///< in every run that read this map
    bool closed = false;
  };

  Node& at(std::string_view path);
  static Json build(const Node& node);

  Node root_ = {};
  std::set<std::string> visited_;
  std::map<std::string, std::set<std::string>> required_;  ///< in this run
  std::optional<std::string> optional_;                    ///< path, in this run
  std::set<std::pair<std::string, std::string>> known_;
  std::set<std::string> kinds_;  ///< of files that are named
  std::vector<Setting> found_;
};

}  // namespace handsim
